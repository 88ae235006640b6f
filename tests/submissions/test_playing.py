"""Playing an entry: finished episodes are not repeated, equal entries give equal bundles, and rows are shuffled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.splits.loading import Split, cases_from_frame
from dextron_bench.submissions import playing
from tests.helpers import forged_bundles, tiny_benchmark


def test_equal_submissions_have_equal_bytes_and_nothing_is_played_twice(submitted: Path, tmp_path: Path):
    entry = forged_bundles.entry_of(submitted, (0, 1))

    def forbidden(*_: object) -> None:
        raise AssertionError("played again")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(playing, "play_shuffled", forbidden)
        folder = playing.play_entry(entry, submitted / "runs", 1, Limits(), threads=1)
    playing.write_bundle(entry, folder, tmp_path / "again.zip")
    assert (tmp_path / "again.zip").read_bytes() == (submitted / "twins.zip").read_bytes()


def test_episodes_are_played_in_an_order_that_depends_on_split_and_seed():
    cases = tuple(cases_from_frame(tiny_benchmark.ROWS)) * 20
    split = Split(name="test", reaches="synthetic", digest="0" * 64, cases=cases)
    first, second = playing.row_order(split, 0), playing.row_order(split, 1)
    assert sorted(first) == list(range(len(split.cases)))
    assert list(first) != list(range(len(first)))
    assert list(first) != list(second)
    assert list(playing.row_order(replace(split, digest="1" * 64), 0)) != list(first)
