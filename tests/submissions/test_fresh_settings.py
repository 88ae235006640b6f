"""On fresh settings, an agent that knows the splits by heart scores less, and an honest one does not."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.experts import policies
from dextron_bench.leaderboard import add, verify_board
from dextron_bench.methods.isolation import sandbox
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.scores import standings
from dextron_bench.splits import fresh, fresh_settings
from dextron_bench.splits.fresh_settings import FreshSettings
from dextron_bench.splits.loading import Split, cases_from_frame, split_digest
from dextron_bench.submissions import bundle, entry, playing, verification
from dextron_bench.submissions.seed_check import Playing
from dextron_bench.submissions.verdict import Verdict
from dextron_bench.world.engine import Engine
from tests.helpers import forged_bundles, tiny_benchmark
from tests.helpers.forged_bundles import Forgery
from tests.helpers.short_reaches import SOURCE

needs_sandbox = pytest.mark.skipif(not sandbox.is_available(), reason="bubblewrap is not installed")
FRESH = FreshSettings("0" * 64, "a beacon", rows=16)


def draw(reaches: str, name: str, seed: int, *_: object) -> Split:
    """Instead of a search: two settings that an expert solves, with noise that follows from the seed."""
    rows = pd.DataFrame([("-", *one) for one in tiny_benchmark.SOLVED], columns=tiny_benchmark.COLUMNS)
    table = rows.assign(window=0.0, duration_noise=rows["duration_noise"] + seed % 7 / 1000)
    return Split(name=name, reaches=reaches, digest=split_digest(table), cases=tuple(cases_from_frame(table)))


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fresh, "draw", draw)


@pytest.fixture(scope="module")
def merged(submitted: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A board with a submission that played fresh settings."""
    if not sandbox.is_available():
        pytest.skip("bubblewrap is not installed")
    forged = forged_bundles.taken_apart(submitted / "near.zip", tmp_path_factory.mktemp("merged"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fresh, "draw", draw)
        add.merge(forged.checked(rerun=True, fresh=FRESH), forged.board, forged.folder / "agent")
    return forged.board


@pytest.fixture
def board(merged: Path, drawn: None, tmp_path: Path) -> Path:
    """A copy of that board."""
    return shutil.copytree(merged, tmp_path / "board")


@pytest.mark.slow
def test_the_scores_on_fresh_settings_name_what_they_follow_from(board: Path):
    result = json.loads((board / "results/near/synthetic/seed0/result.json").read_text())
    played = result["fresh"]
    assert (played["beacon"], played["submission"]) == ("a beacon", "0" * 64)
    assert set(played["splits"]) == {"test", "unseen-reach"}
    assert len(played["splits"]["test"]["scores"]) == 2
    table = pd.read_csv(board / "table.csv").set_index(["method", "split"])
    mean = np.mean(played["splits"]["test"]["scores"])
    assert table.loc[("near", "test"), "fresh"] == pytest.approx(mean)


@pytest.mark.slow
def test_the_terminal_shows_fresh_scores_and_the_mark(board: Path, capsys: pytest.CaptureFixture[str]):
    words = ["leaderboard", "show", "--runs", str(board / "results")]
    assert main.main(words) == 0
    shown = capsys.readouterr().out
    assert "fresh [95 %]" in shown
    assert "not on fresh settings" not in shown
    for file in board.glob("results/near/synthetic/seed*/result.json"):
        result = json.loads(file.read_text())
        for scores, score in ((result, 20.0), (result["fresh"], 0.0)):
            scores["splits"]["test"]["scores"] = [score for _ in scores["splits"]["test"]["scores"]]
        file.write_text(json.dumps(result))
    assert main.main(words) == 0
    assert "not on fresh settings" in capsys.readouterr().out


def findings(board: Path, redraw: bool) -> list[str]:
    return [p for row in verify_board.rows(board) for p in verify_board.check(row, board, redraw=redraw).problems]


@pytest.mark.slow
def test_fresh_scores_of_the_board_are_verified(board: Path):
    assert findings(board, redraw=True) == []
    file = board / "results/near/synthetic/seed0/result.json"
    result = json.loads(file.read_text())
    result["fresh"]["splits"]["test"]["scores"][0] = 1.0
    file.write_text(json.dumps(result))
    assert findings(board, redraw=False) == ["its scores on fresh settings differ from its actions, played again"]


@pytest.mark.slow
def test_settings_that_do_not_follow_from_the_beacon_are_a_problem(board: Path):
    """Another beacon is claimed: plain verification replays the actions, and only a new draw shows the difference."""
    file = board / "results/near/synthetic/seed0/result.json"
    result = json.loads(file.read_text())
    result["fresh"]["beacon"] = "another"
    file.write_text(json.dumps(result))
    assert findings(board, redraw=False) == []
    assert findings(board, redraw=True) == ["its fresh settings of test, unseen-reach do not follow from its beacon"]


def test_a_bundle_cannot_bring_fresh_scores(forged: Forgery):
    forged.json("seed0/result.json", lambda result: result.update(fresh={"beacon": "", "submission": "", "splits": {}}))
    assert "fresh" in "".join(forged.checked().problems)


def test_a_beacon_is_random_by_default():
    assert FreshSettings("0").beacon != FreshSettings("0").beacon


def test_settings_survive_the_way_through_a_table(drawn: None):
    splits = [fresh.draw("synthetic", name, 3, Engine(1, 1)) for name in ("test", "unseen-reach")]
    assert fresh_settings.from_frame(fresh_settings.to_frame(splits), "synthetic") == splits


# Agents on a split of eight solved settings of two short reaches, and on eight fresh settings. With `--thorough`
# twelve and forty, and a third agent, whose gap is beyond noise on as many only.

MEMORY = """
import numpy as np
from dextron_bench.world import task

STARTS = np.array({starts})  # Place of the palm in the first state of each known setting.
EXPERTS = np.array({experts})


class Memory:
    "Plays the expert of the known setting with the nearest first state, if it is within a limit."

    name = "memory"

    def __init__(self, limit=1.0):
        self.limit = limit
        self.expert, self.first, self.new = np.zeros((4096, 2)), np.ones(4096), np.zeros(4096, bool)

    def agent(self, seed):
        return self

    def reset(self, episodes):
        self.new[episodes] = True

    def act(self, states):
        distance, n = task.distance(states), len(states)
        for row in np.flatnonzero(self.new[:n]):
            apart = np.abs(STARTS - states[row, 7:10]).max(axis=1)
            near = apart.min() < self.limit
            self.expert[row] = EXPERTS[apart.argmin()] if near else (1.0, 0.0)
            self.first[row] = distance[row]
        gain, critical = self.expert[:n].T
        closing = (distance / self.first[:n] < critical) | ((distance < {always}) & (critical > 0))
        speeds = np.clip(gain * (np.where(closing, {closed}, {open}) - task.closure(states)), -1.0, 1.0)
        speeds[self.new[:n]] = 0.0
        self.new[:n] = False
        return speeds[:, None]
"""


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory, thorough: bool) -> Iterator[Path]:
    """A split of solved settings, and a file with an agent that knows their first states and experts."""
    folder, engine = tmp_path_factory.mktemp("fresh"), Engine(1024, 2)
    known = fresh.solved(SOURCE, frozenset("ab"), 12 if thorough else 8, 99, engine)
    cases = cases_from_frame(known)
    starts = engine.begin(np.arange(len(cases)), [SOURCE.path(case.setting) for case in cases])[:, 7:10]
    numbers = {"always": policies.ALWAYS_CLOSE, "closed": policies.CLOSED, "open": policies.OPEN}
    experts = [[case.expert.gain, case.expert.critical] for case in cases]
    (folder / "memory.py").write_text(MEMORY.format(starts=starts.tolist(), experts=experts, **numbers))
    (folder / "near.py").write_text(forged_bundles.AGENT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fresh, "BLOCK", 32)
        tiny_benchmark.install(tiny_benchmark.write(folder / "splits", known.assign(split="test")), patch.setattr)
        drawn = replace(FRESH, rows=40 if thorough else 8).draw(tiny_benchmark.NAME)
        patch.setattr(FreshSettings, "draw", lambda *_: drawn)  # Once for all agents.
        yield folder
    tiny_benchmark.forget()


def verified(here: Path, name: str, spec: str, settings: dict[str, float]) -> Verdict:
    """What `leaderboard verify --rerun` finds for an agent."""
    one = entry.Entry(name, f"{here}/{spec}", tiny_benchmark.NAME, (0,), settings)
    limits = Limits(start=300.0, answer=100.0)
    file, into = here / f"{name}.zip", here / f"{name}-unpacked"
    playing.write_bundle(one, playing.play_entry(one, here / "runs", 0, limits), file)
    manifest = bundle.unpack(file, into)
    return verification.verify(into, manifest, how=Playing(limits), rerun=True, fresh=FRESH)


AGENTS = {  # By name: class, settings, and whether the row is marked.
    "memoriser": ("memory.py:Memory", {"limit": 1e-9}, True),
    "honest": ("near.py:Near", {"near": 0.06}, False),
    "neighbour": ("memory.py:Memory", {"limit": 1.0}, True),
}


@pytest.mark.thorough
@needs_sandbox
def test_a_memory_of_the_splits_is_marked_and_an_honest_rule_is_not(here: Path, thorough: bool):
    for name in list(AGENTS)[: 3 if thorough else 2]:
        spec, settings, is_marked = AGENTS[name]
        verdict = verified(here, name, spec, settings)
        assert verdict.problems == []
        [row] = standings.table(verdict.results.values()).to_dict("records")
        assert row["marked"] == is_marked, name
        if is_marked:
            assert row["return"] == 20.0  # Perfect on what it knows; the mark says that it scores less on fresh ones.
