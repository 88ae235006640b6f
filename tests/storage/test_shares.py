"""Shares and pieces: which pieces belong to a share, how many blocks are needed, and what the stamp holds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dextron_bench.storage import atomic, block_work, pieces, provenance, shares
from dextron_bench.storage.pieces import ListedWork, Recipe
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.shares import Share

SIZES = (("a", 2), ("b", 3))  # Of works, by name: how many pieces they have.


@dataclass(frozen=True)
class Work(ListedWork):
    """Work whose pieces depend on `configs`, by name."""

    place: Path
    code_hash: str
    configs: Mapping[str, Mapping[str, Any]]

    @property
    def code(self) -> str:
        return self.code_hash

    def names(self) -> list[str]:
        return list(self.configs)

    def config_of(self, name: str) -> Mapping[str, Any] | None:
        return self.configs.get(name)

    def play(self, name: str, report: Progress = no_progress) -> list[Path]:
        atomic.write_atomically(file := self.file(name, ".bin"), lambda part: part.write_bytes(b"1"))
        return self.complete(name, [file])

    def recipe(self, name: str) -> Recipe:
        raise NotImplementedError


@given(st.integers(1, 7), st.integers(0, 50))
def test_every_place_belongs_to_one_share(of: int, place: int):
    assert sum(Share(index, of).has(place) for index in range(of)) == 1


@pytest.mark.parametrize("text", ["2/2", "-1/2", "half", "1", "1/", "/2", "0/0"])
def test_shares_that_do_not_exist_are_refused(text: str):
    with pytest.raises(shares.BadShare, match="share"):
        Share.parse(text)


def test_the_number_of_blocks_has_a_margin_of_two_standard_errors():
    """Four blocks of 2, 4, 2, 4: mean 3, deviation 1, so the mean has the standard error 0.5, a sixth of it."""
    assert block_work.blocks_needed([2, 4, 2, 4], 30) == math.ceil(10 * (1 + 2 / 6)) == 14
    assert block_work.blocks_needed([5], 30) == 6
    assert block_work.blocks_needed([0, 0], 30) == block_work.blocks_needed([], 30) == math.inf


def test_a_message_names_the_first_pieces_that_are_missing():
    names = [f"p{k}" for k in range(9)]
    shares.check_complete("the merge", names, set(names))
    with pytest.raises(shares.MissingPieces, match=r"^the merge lacks 6 of 9 pieces: p0, p2, p4, p5, \.\.\.; run the"):
        shares.check_complete("the merge", names, {"p1", "p3", "p8"})


def test_a_stamp_holds_what_a_piece_depends_on_and_only_its_own_files_are_removed(tmp_path: Path):
    config = {"physics": "f00", "seed": 3, "policies": ("a", "b")}
    work = Work(tmp_path, "c0de", {"a": config})
    outside, inside = tmp_path / "recordings" / "a.rrd", work.file("a", ".bin")
    for file in (outside, inside):
        file.parent.mkdir()
        file.write_bytes(b"1")
    work.complete("a", [inside, outside])
    stamp = json.loads((tmp_path / "pieces" / "a.json").read_text())
    one = "6b86b273ff34fce19d6b804eff5a3f5747ada4eaa22f1d49c01e52ddb7875b4b"  # SHA-256 of "1".
    assert stamp["files"] == {"pieces/a.bin": one, "recordings/a.rrd": one}
    assert (stamp["code"], stamp["depends on"]["seed"], stamp["provenance"]["physics"]) == ("c0de", 3, "f00")
    assert Work(tmp_path, "c0de", {}).stored() == {}
    stored = work.stored()
    assert set(stored["a"].files) == {inside, outside}
    with pytest.raises(pieces.ForeignPiece, match="differs in the benchmark's code and seed;"):
        Work(tmp_path, "other", {"a": config | {"seed": 4}}).stored()
    work.remove(stored.values())
    assert outside.exists()
    assert not (tmp_path / "pieces").exists()


def test_a_stamp_that_is_no_stamp_is_named(tmp_path: Path):
    atomic.write_json(tmp_path / "pieces" / "a.json", {"name": "a"})
    with pytest.raises(atomic.DamagedFile, match=r"a\.json is damaged or of another version \(it lacks 'depends on'\)"):
        Work(tmp_path, "c0de", {}).stored()


def test_merged_provenance_does_not_depend_on_order_or_doubles():
    a, b, c = ({"machine": {"cpu": name}} for name in "abc")
    expected = {"machine": {"cpu": "a"}, "others": [b, c]}
    assert provenance.merged([c, a, b]) == provenance.merged([b, provenance.merged([c, a]), a]) == expected
    assert provenance.merged([b, b]) == b


def test_the_hash_of_the_code_depends_on_names_and_contents_of_more_files(tmp_path: Path):
    first, second = tmp_path / "a.py", tmp_path / "b.py"
    first.write_text("1")
    second.write_text("1")
    hashes = [provenance.code_hash(), provenance.code_hash(first), provenance.code_hash(second)]
    first.write_text("2")
    assert len({*hashes, provenance.code_hash(first)}) == 4


def test_a_file_of_a_piece_that_was_not_copied_is_missing_and_nothing_is_damaged(tmp_path: Path):
    work = Work(tmp_path, "c0de", {"a": {"seed": 3, "physics": "p"}})
    file, _ = work.play("a")
    file.unlink()
    with pytest.raises(atomic.IncompleteFolder, match=r"a\.bin is missing, and a\.json needs it\); if it is a copy"):
        work.stored()


def test_shares_play_each_piece_of_several_works_once(tmp_path: Path):
    """Of five pieces of two works, share 0/2 has the first, the third and the fifth; a second time it plays nothing."""
    works = [Work(tmp_path / name, name, {f"{name}{k}": {"physics": "f00"} for k in range(n)}) for name, n in SIZES]
    shown: list[str] = []

    def bar(title: str) -> AbstractContextManager[Progress]:
        shown.append(title)
        return nullcontext(no_progress)

    assert shares.play(works, Share(0, 2), bar) == shares.play(works, Share(0, 2), bar) == "3 of 5 pieces"
    assert shown == ["a0", "b0", "b2"]
    with pytest.raises(shares.MissingPieces, match="the merge lacks 2 of 5 pieces: a1, b1;"):
        shares.check(works)
    shares.play(works, Share(1, 2), bar)
    shares.check(works)
