"""Shares of a data set: the same bytes as without shares, and what a merge lacks."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from baselines.floors import Nothing
from dextron_bench.storage import shares
from dextron_bench.success import generation, sharing
from tests.helpers.short_reaches import SOURCE
from tests.helpers.tiny_runs import forbidden
from tests.success.test_generation import SMALL, TRAIN, file_contents, generate_small

ROWS = 3000  # In eleven blocks.


def generate_share(folder: Path, text: str) -> int:
    agents, share = {"nothing": Nothing().agent(0)}, shares.Share.parse(text)
    return sharing.generate_share(SOURCE, TRAIN, SMALL, folder, ROWS, agents, share, threads=1)


@pytest.mark.slow
def test_shares_in_any_order_give_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    tallies = generate_small(tmp_path / "whole", ROWS)
    merged = tmp_path / "merged"
    for text, part in (("1/2", tmp_path / "b"), ("0/2", tmp_path / "a")):
        assert generate_share(part, text) > 0
        shutil.copytree(part, merged, dirs_exist_ok=True)
    generate_share(merged, "0/1")  # A share of all plays what is still missing.
    sharing.check_complete(merged, SMALL, ROWS)
    monkeypatch.setattr(generation, "rollout", forbidden)
    assert generate_small(merged, ROWS) == tallies
    assert file_contents(merged) == file_contents(tmp_path / "whole")  # Blocks that are not needed are gone.


def test_a_merge_names_the_blocks_that_are_missing(tmp_path: Path):
    with pytest.raises(shares.MissingPieces, match="lacks the blocks from 000000 on: the blocks before have 0 of 3000"):
        sharing.check_complete(tmp_path, SMALL, ROWS)
    generate_share(tmp_path, "1/2")
    with pytest.raises(shares.MissingPieces, match=r"lacks \d of \d+ pieces: block 000000, block 000001"):
        sharing.check_complete(tmp_path, SMALL, ROWS)


def test_a_piece_of_another_data_set_is_refused(tmp_path: Path):
    generate_share(tmp_path / "a", "0/1")
    other = generation.DatasetConfig("synthetic", seed=1, block=5, policies=("nothing",))
    (tmp_path / "a" / "search.json").unlink()
    with pytest.raises(
        shares.ForeignPiece, match=r"000000.json is a piece of other work: it differs in search \(seed\)"
    ):
        sharing.check_complete(tmp_path / "a", other, ROWS)
