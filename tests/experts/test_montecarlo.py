"""The search: equal rows after any interruption, and the distributions of the paper."""

import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench.errors import BadInput, NotFound
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import blocks, database, montecarlo, outcomes, policies
from dextron_bench.experts.blocks import Tally
from dextron_bench.experts.montecarlo import Search
from dextron_bench.experts.search_work import SearchWork
from dextron_bench.reaches import setting
from dextron_bench.storage import block_work, provenance, tables
from dextron_bench.storage.shares import Share
from dextron_bench.world.engine import Engine
from tests.helpers.short_reaches import SOURCE

Blocks = Iterator[tuple[int, pd.DataFrame]]  # Numbers of blocks, and their draws.
SMALL = Search("brief", seed=3, experts=3, block=4)


def search(folder: Path, rows: int, slots: int = 12, threads: int = 1) -> pd.DataFrame:
    return SearchWork(SMALL, folder, rows, SOURCE, Engine(slots, threads)).run()


def work_in(folder: Path, rows: int = 3, search: Search = SMALL) -> SearchWork:
    return SearchWork(search, folder, rows, SOURCE, Engine(12, 1))


def search_share(folder: Path, text: str, rows: int = 3) -> int:
    return int(work_in(folder, rows).play_share(Share.parse(text)).removesuffix(" blocks"))


@pytest.fixture
def quick_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Outcomes follow from d_c alone, so that tests of files need no simulation."""

    def played(source: object, engine: object, drawn: Blocks, experts: int) -> Blocks:
        for number, draws in drawn:
            yield number, draws.assign(score=np.where(draws["critical"].between(0.2, 0.3), 20.0, 0.5), length=50)

    monkeypatch.setattr(outcomes, "play_blocks", played)


def nothing_left(source: object, engine: object, drawn: Blocks, experts: int) -> Blocks:
    """Takes the place of `outcomes.play_blocks` where no block should be missing."""
    assert next(drawn, None) is None, "played a block again"
    yield from ()


def test_draws_are_uniform_with_one_expert_in_each_band():
    draws = montecarlo.draw(SOURCE, Search("brief", experts=4, block=500), block=0)
    assert len(draws) == 2000
    low, high = policies.CRITICAL_DISTANCE
    band = ((draws["critical"] - low) / (high - low) * 4).astype(int).to_numpy().reshape(500, 4)
    assert (band == [0, 1, 2, 3]).all()
    assert draws["gain"].between(1.0, 1.5).all()
    assert draws["offset_x"].between(-0.06, 0.06).all()
    assert (draws.groupby(np.arange(2000) // 4)["gain"].nunique() == 1).all()
    assert abs(draws["critical"].mean() - 0.455) < 0.01
    assert abs(draws["duration_noise"].mean()) < 0.15


def test_a_block_depends_only_on_its_number_and_the_seed():
    first, again = montecarlo.draw(SOURCE, SMALL, 7), montecarlo.draw(SOURCE, SMALL, 7)
    pd.testing.assert_frame_equal(first, again)
    assert not first.equals(montecarlo.draw(SOURCE, SMALL, 8))
    assert not first.equals(montecarlo.draw(SOURCE, Search("brief", 4, 3, 4), 7))


@pytest.mark.slow
def test_rows_are_the_same_at_any_slots_and_threads_and_after_interruptions(tmp_path):
    whole = search(tmp_path / "whole", rows=2)
    assert (whole["score"] == 20).sum() >= 2
    pd.testing.assert_frame_equal(search(tmp_path / "threads", 2, slots=40, threads=2), whole)
    broken = tmp_path / "broken"
    shutil.copytree(tmp_path / "threads", broken)
    stored = sorted((broken / "blocks").iterdir())
    assert len(stored) >= 3
    for lost in (stored[0], stored[-1]):
        lost.unlink()
    pd.testing.assert_frame_equal(search(broken, rows=2), whole)


@pytest.mark.slow
@pytest.mark.usefixtures("quick_episodes")
@pytest.mark.parametrize("of", [1, 2, 3])
def test_shares_of_any_number_and_order_find_the_same_bytes(of: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Shares that do not see each other may stop too early; put together, they see what is missing."""
    monkeypatch.setattr(provenance, "collect", lambda physics: {"git": "abc", "physics": physics})
    whole, merged = tmp_path / "whole", tmp_path / "merged"
    database.save(search(whole, rows=3), SOURCE, SMALL, whole, "experts")
    for _ in range(4):
        for index in reversed(range(of)):
            part = tmp_path / f"part{index}"
            if merged.exists():
                shutil.copytree(merged, part, dirs_exist_ok=True)
            assert search_share(part, f"{index}/{of}") > 0
        for index in range(of):
            shutil.copytree(tmp_path / f"part{index}", merged, dirs_exist_ok=True)
        with suppress(NotFound):
            work_in(merged).check_complete()
            break
    monkeypatch.setattr(outcomes, "play_blocks", nothing_left)
    database.save(search(merged, rows=3), SOURCE, SMALL, merged, "experts")
    for name in ("experts.parquet", "experts.json", "search.json"):
        assert (merged / name).read_bytes() == (whole / name).read_bytes()
    assert not (merged / "pieces").exists()


@pytest.mark.usefixtures("quick_episodes")
def test_a_merge_names_the_blocks_that_are_missing(tmp_path: Path):
    with pytest.raises(NotFound, match=r"lacks the blocks from 000000 on: .* have 0 of 3 rows"):
        work_in(tmp_path).check_complete()
    count = search_share(tmp_path, "1/2")
    with pytest.raises(NotFound, match=rf"lacks {count} of {2 * count} pieces: block 000000"):
        work_in(tmp_path).check_complete()


@pytest.mark.usefixtures("quick_episodes")
def test_a_block_of_a_share_that_differs_from_the_stored_one_is_named(tmp_path: Path):
    search_share(tmp_path, "0/2", rows=1)
    search(tmp_path, rows=1)
    work = work_in(tmp_path, 1)
    draws = pd.read_parquet(work.block_file(0)).assign(score=0.5)
    tables.write(file := work.file("000000", ".parquet"), draws, compression="zstd")
    work.complete("000000", [file])
    with pytest.raises(blocks.DamagedBlock, match=r"it differs from .*pieces/000000\.parquet, which is"):
        search(tmp_path, rows=1)


@pytest.mark.usefixtures("quick_episodes")
def test_two_machines_are_named_in_the_summary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for text, machine in 3 * [("0/2", "small"), ("1/2", "large")]:  # The first one may stop too early.
        monkeypatch.setattr(provenance, "collect", lambda physics, name=machine: {"machine": {"cpu": name}})
        search_share(tmp_path, text)
    monkeypatch.setattr(provenance, "collect", lambda physics: {"machine": {"cpu": "of the merge"}})
    work_in(tmp_path).check_complete()
    _, about = database.save(search(tmp_path, rows=3), SOURCE, SMALL, tmp_path, "experts")
    makers = about.provenance
    assert [makers.machine.cpu, *(maker.machine.cpu for maker in makers.others)] == ["large", "small"]


@pytest.mark.slow
def test_outcomes_equal_the_outcomes_of_experts_played_one_by_one(tmp_path):
    table = search(tmp_path, rows=1)
    agents = [policies.Expert(gain, critical) for gain, critical in zip(table["gain"], table["critical"], strict=True)]
    cases = [policies.Case(s, e, 0.0) for s, e in zip(setting.from_frame(table), agents, strict=True)]
    played = dict(rollout(policies.ExpertAgent(), SOURCE, cases, threads=1))
    assert table["score"].tolist() == [played[i].score for i in range(len(cases))]
    assert table["length"].tolist() == [len(played[i].actions) for i in range(len(cases))]


def test_a_search_stops_at_the_first_block_that_reaches_the_rows():
    done = {0: Tally(1, 8, 3, 2), 1: Tally(1, 8, 0, 0), 2: Tally(1, 8, 5, 4), 4: Tally(1, 8, 9, 9)}
    solved = {number: tally.solved for number, tally in done.items()}
    assert [block_work.last_needed(solved, rows) for rows in (1, 2, 3, 6, 7)] == [0, 0, 2, 2, None]
    assert blocks.total(done) == Tally(4, 32, 17, 15)


@pytest.mark.thorough
def test_a_search_continues_from_the_kept_rows_of_a_database(tmp_path):
    def kept(draws: pd.DataFrame) -> pd.DataFrame:
        return draws[draws["score"] > blocks.KEPT].astype({"length": int}).reset_index(drop=True)

    first = search(tmp_path / "first", rows=1)
    count = len(first) // (SMALL.block * SMALL.experts)
    work_in(tmp_path / "second").restore(kept(first), count)
    whole = search(tmp_path / "first", rows=3)
    pd.testing.assert_frame_equal(kept(search(tmp_path / "second", rows=3)), kept(whole))
    with pytest.raises(BadInput, match="row 0 of the database"):
        work_in(tmp_path / "other", search=Search("brief", 4, 3, 4)).restore(kept(first), count)


@pytest.mark.usefixtures("quick_episodes")
def test_a_folder_holds_one_search(tmp_path):
    search(tmp_path, rows=1)
    with pytest.raises(BadInput, match="holds another search"):
        work_in(tmp_path, 1, Search("brief", seed=4, experts=3, block=4)).run()


@pytest.mark.usefixtures("quick_episodes")
def test_a_damaged_block_is_named(tmp_path):
    search(tmp_path, rows=1)
    block = sorted((tmp_path / "blocks").iterdir())[0]
    block.write_bytes(block.read_bytes()[:100])
    with pytest.raises(blocks.DamagedBlock, match=f"{block.name} is damaged"):
        search(tmp_path, rows=1)


def edited(draws: pd.DataFrame) -> pd.DataFrame:
    """The draws with one return changed; their attributes hold the digest of the old values."""
    scores = draws["score"].to_numpy(copy=True)
    scores[0] = 10.0 - scores[0] / 2.0
    draws["score"] = scores
    return draws


DAMAGES = [
    (lambda draws: draws.drop(columns="score"), "it lacks the column 'score'"),
    (edited, "its values differ from the digest that it carries"),
    (lambda draws: draws.head(5), "it has 5 rows, and a block of this search has 12"),
    (lambda draws: draws.assign(gain=1.25), "its column 'gain' differs from the draws of this search"),
    (lambda draws: draws.assign(score=np.inf), "its column 'score' has values that do not belong there"),
]


@pytest.mark.usefixtures("quick_episodes")
def test_a_block_that_is_cut_edited_or_of_another_search_is_named(tmp_path):
    search(tmp_path, rows=1)
    block = sorted((tmp_path / "blocks").iterdir())[0]
    whole = block.read_bytes()
    for change, reason in DAMAGES:
        draws = change(pd.read_parquet(block))
        if change is edited:
            draws.to_parquet(block)
        else:
            tables.write(block, draws)
        with pytest.raises(blocks.DamagedBlock) as caught:
            search(tmp_path, rows=1)
        foreign = f"{block} is not of this search or of another version ({reason}); move it away and search again, or "
        damaged = f"{block} is damaged ({reason}); remove it and search again"
        assert str(caught.value).startswith(damaged if change is edited else foreign)
        block.write_bytes(whole)


WHOLE = """
import sys
from pathlib import Path
from tests.experts.test_montecarlo import search
folder = Path(sys.argv[1])
search(folder, rows=2).to_parquet(folder / "draws.parquet")
"""


@pytest.mark.slow
def test_a_killed_search_continues_to_the_same_rows(tmp_path):
    """It is killed before its first block, and then with two blocks."""

    def start(folder: Path) -> subprocess.Popen[bytes]:
        return subprocess.Popen([sys.executable, "-c", WHOLE, str(folder)], cwd=Path(__file__).parents[2])

    def count(folder: Path) -> int:
        return len(list(folder.glob("blocks/*.parquet")))

    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert start(whole).wait() == 0
    assert count(whole) >= 3
    for blocks_before in (0, 2):
        process = start(killed)
        while count(killed) < blocks_before or not killed.exists():
            assert process.poll() is None
            time.sleep(0.01)
        time.sleep(0.3)
        process.kill()
        assert process.wait() == -signal.SIGKILL
        assert not (killed / "draws.parquet").exists()
    assert start(killed).wait() == 0
    assert (killed / "draws.parquet").read_bytes() == (whole / "draws.parquet").read_bytes()
