"""`doctor` lists every package that the project depends on."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from dextron_bench.cli import doctor, main

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
# Extras; the others are for developers.
FOR_USERS = ("minari", "video", "onnx", "sweep", "tensorboard", "trackio", "wandb", "cluster", "mlflow")


def names(requirements: list[str]) -> set[str]:
    return {re.split(r"[\[<>=]", requirement)[0] for requirement in requirements}


def test_every_dependency_is_listed_and_packages_of_extras_are_not_needed():
    assert set(doctor.PACKAGES) == names(PROJECT["dependencies"])
    extras = {name: names(PROJECT["optional-dependencies"][name]) for name in FOR_USERS}
    assert all(package in extras[extra] for package, extra in doctor.EXTRAS.items())
    assert set(doctor.EXTRAS.values()) == set(FOR_USERS)


def test_a_missing_package_of_an_extra_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch):
    def missing(name: str) -> str:
        raise doctor.PackageNotFoundError(name)

    monkeypatch.setattr(doctor, "version", missing)
    needed, extra = doctor._package("numpy"), doctor._package("av", "video")
    assert (needed.status, needed.detail) == ("MISSING", "not installed; pip install numpy")
    assert (extra.status, extra.detail) == ("no", "not installed; pip install 'dextron-bench[video]'")


def test_the_command_prints_all_findings(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(doctor, "RENDERERS", ())
    assert main.main(["doctor", "--json"]) in (0, 1)
    listed = {finding["what"] for finding in json.loads(capsys.readouterr().out)}
    assert {*doctor.PACKAGES, *doctor.EXTRAS, "bubblewrap", "reaches synthetic"} <= listed
