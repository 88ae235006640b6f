"""Provenance names the commit, the versions and the machine, and works without git."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec import to_builtins

from dextron_bench.storage import provenance
from dextron_bench.submissions import bundle
from dextron_bench.submissions.manifest import ClaimedResult
from dextron_bench.world import model
from tests.helpers.results import SPLIT


def test_provenance_is_plain_json_and_names_code_versions_and_machine():
    content = to_builtins(provenance.collect(model.mjcf_hash()))
    assert json.loads(json.dumps(content)) == content
    assert {"git", "dirty", "versions", "python", "machine", "physics"} <= set(content)
    assert content["versions"]["mujoco"].startswith("3.")
    assert content["physics"] == model.mjcf_hash()
    assert content["machine"]["cores"] >= 1


def test_a_missing_package_has_no_version():
    assert provenance.version_of("nosuchpackage") is None


def test_without_git_the_commit_is_unknown(monkeypatch: pytest.MonkeyPatch):
    def missing(*_: object, **__: object) -> None:
        raise FileNotFoundError("git")

    monkeypatch.setattr(subprocess, "run", missing)
    assert provenance._git("rev-parse", "HEAD") is None


X86 = """processor\t: 0
model name\t: AMD EPYC 7B13
flags\t\t: fpu mmx smep sse sse2 misalignsse pni ssse3 fma sse4_2 aes avx f16c avx2 vaes avx512f avx512_vnni
processor\t: 1
flags\t\t: none"""
ARM = "processor : 0\nFeatures : fp asimd evtstrm aes crc32 asimdhp sve sve2 sme smei16i64\nCPU part : 0xd40"


def describe_processor(monkeypatch: pytest.MonkeyPatch, describe: Callable[[], str]) -> None:
    """Replaces the content of /proc/cpuinfo, and of no other file."""
    read_text = Path.read_text

    def read(path: Path, *arguments: Any, **named: Any) -> str:
        return describe() if str(path) == "/proc/cpuinfo" else read_text(path, *arguments, **named)

    monkeypatch.setattr(Path, "read_text", read)


@pytest.mark.parametrize(
    ("text", "cpu", "extensions"),
    [
        (
            X86,
            "AMD EPYC 7B13",
            ["avx", "avx2", "avx512_vnni", "avx512f", "f16c", "fma", "sse", "sse2", "sse4_2", "ssse3"],
        ),
        (ARM, None, ["asimd", "asimdhp", "sme", "smei16i64", "sve", "sve2"]),
        ("processor : 0\nisa\n: rv64imafdc", None, None),
    ],
    ids=["x86", "arm", "neither"],
)
def test_the_machine_has_its_vector_extensions(
    text: str, cpu: str | None, extensions: list[str] | None, monkeypatch: pytest.MonkeyPatch
):
    describe_processor(monkeypatch, lambda: text)
    machine = provenance.collect("").machine
    assert machine.vector_extensions == extensions
    assert machine.cpu == (cpu or provenance.platform.processor() or provenance.platform.machine())


def test_a_system_that_does_not_describe_its_processor_has_no_vector_extensions(monkeypatch: pytest.MonkeyPatch):
    def missing() -> str:
        raise FileNotFoundError("/proc/cpuinfo")

    describe_processor(monkeypatch, missing)
    assert provenance.vector_extensions() is None
    assert provenance.collect("").machine.cpu


@pytest.mark.parametrize("extensions", ["as here", "unknown", "of an earlier version"])
def test_bundles_may_have_any_provenance_that_was_ever_written(extensions: str):
    content = to_builtins(provenance.collect(model.mjcf_hash()))
    if extensions == "unknown":
        content["machine"]["vector_extensions"] = None
    elif extensions == "of an earlier version":
        del content["machine"]["vector_extensions"]
    result = {"method": "a", "reaches": "real", "seed": 0, "provenance": content}
    result["splits"] = {"test": SPLIT | {"digest": "0" * 64}}
    bundle.check(result, ClaimedResult, Path("a.zip"))
    content["machine"]["vector_extensions"] = ["<b>"]
    with pytest.raises(bundle.BadBundle, match="provenance/machine/vector_extensions/0 in the result is invalid"):
        bundle.check(result, ClaimedResult, Path("a.zip"))
