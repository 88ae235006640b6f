"""Provenance names the commit, the versions and the machine, and works without git."""

from __future__ import annotations

import json
import subprocess

import pytest

from dextron_bench.storage import provenance
from dextron_bench.world import model


def test_provenance_is_plain_json_and_names_code_versions_and_machine():
    content = provenance.collect(model.mjcf_hash())
    assert json.loads(json.dumps(content)) == content
    assert {"git", "dirty", "versions", "python", "machine", "physics"} <= set(content)
    assert content["versions"]["mujoco"].startswith("3.")
    assert content["physics"] == model.mjcf_hash()
    assert content["machine"]["cores"] >= 1


def test_a_missing_package_has_no_version():
    assert provenance._version("nosuchpackage") is None


def test_without_git_the_commit_is_unknown(monkeypatch: pytest.MonkeyPatch):
    def missing(*_: object, **__: object) -> None:
        raise FileNotFoundError("git")

    monkeypatch.setattr(subprocess, "run", missing)
    assert provenance._git("rev-parse", "HEAD") is None
