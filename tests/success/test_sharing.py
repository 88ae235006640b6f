"""Shares of a data set: the same bytes as without shares, and what a merge lacks."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from baselines.floors import Nothing
from dextron_bench.storage import shares
from dextron_bench.storage.pieces import ForeignPiece, Place
from dextron_bench.success import generation
from tests.helpers.short_reaches import SOURCE
from tests.helpers.tiny_runs import forbidden
from tests.success.test_generation import SMALL, TRAIN, file_contents, generate_small

ROWS = 3000  # In eleven blocks.


def work_in(folder: Path, config: generation.DatasetConfig = SMALL) -> generation.Generation:
    return generation.Generation(config, folder, ROWS, SOURCE, TRAIN, {"nothing": Nothing().agent(0)}, threads=1)


def generate_share(folder: Path, text: str) -> int:
    return int(work_in(folder).play_share(shares.Share.parse(text)).removesuffix(" blocks"))


@pytest.mark.slow
def test_shares_in_any_order_give_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    tallies = generate_small(tmp_path / "whole", ROWS)
    merged = tmp_path / "merged"
    for text, part in (("1/2", tmp_path / "b"), ("0/2", tmp_path / "a")):
        assert generate_share(part, text) > 0
        shutil.copytree(part, merged, dirs_exist_ok=True)
    generate_share(merged, "0/1")  # A share of all plays what is still missing.
    work_in(merged).check_complete()
    monkeypatch.setattr(generation, "rollout", forbidden)
    assert generate_small(merged, ROWS) == tallies
    assert file_contents(merged) == file_contents(tmp_path / "whole")  # Blocks that are not needed are gone.


def test_a_merge_names_the_blocks_that_are_missing(tmp_path: Path):
    with pytest.raises(shares.MissingPieces, match="lacks the blocks from 000000 on: the blocks before have 0 of 3000"):
        work_in(tmp_path).check_complete()
    generate_share(tmp_path, "1/2")
    with pytest.raises(shares.MissingPieces, match=r"lacks \d of \d+ pieces: block 000000, block 000001"):
        work_in(tmp_path).check_complete()


@pytest.mark.slow
def test_a_piece_of_another_data_set_is_refused(tmp_path: Path):
    generate_share(tmp_path / "a", "0/1")
    other = generation.DatasetConfig("synthetic", seed=1, block=5, policies=("nothing",))
    (tmp_path / "a" / "search.json").unlink()
    with pytest.raises(ForeignPiece, match=r"000000.json is a piece of other work: it differs in search \(seed\)"):
        work_in(tmp_path / "a", other).check_complete()


def test_another_process_reads_the_weights_of_policies_from_its_folder_of_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The recipe sends each file by the policy's name, and names no path of this machine."""
    read: list[Path] = []
    monkeypatch.setattr(generation.weights, "load_agent_from_file", lambda file: read.append(file) or object())
    monkeypatch.setattr(generation, "load_split", lambda reaches, name: TRAIN)
    monkeypatch.setattr(generation, "open_source", lambda reaches: SOURCE)
    here, there = Place(tmp_path, tmp_path / "data", 1), Place(tmp_path / "node", tmp_path / "node" / "data", 1)
    work = generation.open_generation(here, SMALL, ROWS, {"nothing": tmp_path / "a.safetensors"})
    recipe = work.recipe("000000")
    assert recipe.files == {"policies/nothing": tmp_path / "a.safetensors"}
    again = recipe.make(there, **recipe.arguments)
    assert read == [tmp_path / "a.safetensors", tmp_path / "node" / "policies" / "nothing"]
    assert isinstance(again, generation.Generation)
    assert (again.config, again.goal, again.place) == (SMALL, ROWS, tmp_path / "node" / "data")
