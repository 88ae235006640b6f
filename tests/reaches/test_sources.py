"""Sources by name: the types of the command line list the sources that exist, and cost nothing to import."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import pytest

from dextron_bench.reaches.recorded import cache
from dextron_bench.reaches.recorded.release import Manifest
from dextron_bench.reaches.setting import Source
from dextron_bench.reaches.sources import SOURCES, RankedSource, SourceName, UnknownSource, open_source
from tests.helpers.small_release import NAMES, SmallRelease


def test_the_types_list_the_sources_in_their_order():
    assert get_args(SourceName) == tuple(SOURCES) == ("real", "synthetic", "minjerk")
    assert set(get_args(RankedSource)) < set(SOURCES)


def test_the_types_import_nothing_heavy():
    code = "import sys, dextron_bench.reaches.sources; print({'mujoco', 'pandas', 'scipy'} & sys.modules.keys())"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed == "set()\n"


@pytest.mark.parametrize("name", ["synthetic", "minjerk"])
def test_a_source_has_the_name_that_opens_it(name: str):
    assert open_source(name).name == name


def test_tests_read_the_real_reaches_that_are_imported(
    small_release: SmallRelease, opened: Callable[[str], Source], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Without them, and without the authors' release, such a test is skipped."""
    manifest = Manifest.load(small_release.manifest)
    monkeypatch.setattr(Manifest, "load", lambda: manifest)
    monkeypatch.setenv("DEXTRON_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("DEXTRON_DATA", str(tmp_path / "missing"))
    cache.import_release(small_release.zip())
    assert opened("real").names == NAMES


def test_an_unknown_name_lists_the_sources():
    with pytest.raises(UnknownSource, match="no source of reaches 'Real'; choose from minjerk, real, synthetic"):
        open_source("Real")


@pytest.mark.parametrize("name", [None, 3, ["real"]])
def test_a_name_that_is_no_text_is_unknown(name: Any) -> None:
    with pytest.raises(UnknownSource, match="choose from minjerk, real, synthetic"):
        open_source(name)
