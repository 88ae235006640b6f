"""Verification accepts valid submissions, and refuses every forgery of the documented attacks with a reason."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench.methods.isolation import sandbox
from tests.helpers.forged_bundles import Forgery, row, taken_apart

needs_sandbox = pytest.mark.skipif(not sandbox.is_available(), reason="bubblewrap is not installed")


@needs_sandbox
def test_a_valid_submission_is_replayed_bit_for_bit_and_its_agent_run_again(submitted: Path, tmp_path: Path):
    """One of the four episodes of each seed knocks the bottle over."""
    verdict = taken_apart(submitted / "twins.zip", tmp_path).checked(rerun=True)
    assert verdict.problems == []
    assert verdict.notes[-1] == "all seeds have the same episodes: they count as one, not as several trainings"
    assert (verdict.tier, verdict.episodes, verdict.exact) == ("re-run", 8, 8)
    assert verdict.results[0]["splits"]["test"]["scores"] == [20.0, 20.0, 0.0]


@pytest.mark.slow
def test_without_a_sandbox_the_agent_runs_only_if_it_is_trusted_and_its_tier_stays_replayed(
    forged: Forgery, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(sandbox, "is_available", lambda: False)
    refused = forged.checked(rerun=True)
    assert "runs in a sandbox only" in refused.problems[0]
    assert refused.tier == "replayed"
    trusted = forged.checked(rerun=True, trust=True)
    assert trusted.problems == []
    assert trusted.tier == "replayed"
    assert "without a sandbox" in trusted.notes[0]


@pytest.mark.slow
def test_a_changed_reward_is_refused(forged: Forgery):
    forged.table(row(2, score=20.0, success=True, cause="solved"))
    forged.conclude()
    assert "says success True; played again it is False" in forged.checked().problems[0]


def test_a_changed_action_is_refused(forged: Forgery):
    rows = pd.read_parquet(forged.seed / "episodes.parquet").query("split == 'test' and row == 0")
    actions = np.array(rows["actions"].iloc[0])
    actions[-1] = np.nextafter(actions[-1], 0.0)
    forged.table(row(0, actions=actions))
    forged.conclude()
    assert "its hash of states, actions and rewards differs" in "".join(forged.checked().problems)


@pytest.mark.slow
def test_invalid_or_missing_actions_are_refused(forged: Forgery):
    forged.table(row(0, actions=np.array([2.0])))
    assert "row 0 has actions that are not" in forged.checked().problems[0]
    forged.table(row(0, actions=np.zeros(3), length=3))
    forged.conclude()
    assert "played again it is" in "".join(forged.checked().problems)


def test_a_changed_setting_is_refused(forged: Forgery):
    forged.table(row(2, offset_x=-0.015, offset_y=0.005))
    assert "test: row 2 has another setting than the split" in forged.checked().problems[0]


def test_a_dropped_episode_is_refused(forged: Forgery):
    forged.table(lambda table: table[table["score"] > 0])
    forged.conclude()
    assert "has 3 episodes, but the splits have 4" in forged.checked().problems[0]


def test_a_good_episode_that_replaces_a_bad_one_is_refused(forged: Forgery):
    def duplicate(table: pd.DataFrame) -> pd.DataFrame:
        good = table[(table["split"] == "test") & (table["row"] == 0)]
        return pd.concat([table[table["score"] > 0], good], ignore_index=True)

    forged.table(duplicate)
    forged.conclude()
    problems = forged.checked().problems
    assert "test: row 0 appears 2 times" in problems[0]
    assert "test: row 2 is missing" in problems[1]
    forged.table(lambda table: table.assign(row=[0, 1, 0, 2]))
    assert "row 2 has another setting" in "".join(forged.checked().problems)


def test_swapped_splits_are_refused(forged: Forgery):
    names = {"test": "unseen-reach", "unseen-reach": "test"}
    forged.table(lambda table: table.assign(split=table["split"].map(names)))
    assert "was played on another version of the split" in forged.checked().problems[0]
    forged.table(lambda table: table.assign(split="train"))
    assert "train is not a split that ranks methods" in forged.checked().problems[0]


def test_a_tier_cannot_be_claimed(forged: Forgery):
    forged.json("seed0/result.json", lambda result: result.update(tier="re-run"))
    verdict = forged.checked()
    assert verdict.tier == "replayed"
    assert "tier" not in verdict.results[0]


@pytest.mark.slow
@needs_sandbox
def test_another_agents_episodes_are_refused_unless_the_agent_chooses_them(submitted: Path, forged: Forgery):
    """The board has the same episodes under another name."""
    other = json.loads((submitted / "runs/submissions/near/synthetic/seed0/result.json").read_text()) | {
        "method": "first"
    }
    folder = forged.board / "results" / "first" / "synthetic" / "seed0"
    folder.mkdir(parents=True)
    (folder / "result.json").write_text(json.dumps(other))
    line = "seed0: 3 of 3 episodes on test have exactly the actions of 'first', seed 0"
    replayed = forged.checked()
    assert line in replayed.problems
    rerun = forged.checked(rerun=True)
    assert rerun.problems == []
    assert line in rerun.notes


@pytest.mark.slow
def test_chosen_and_hidden_seeds_are_refused(submitted: Path, tmp_path: Path):
    forged = taken_apart(submitted / "twins.zip", tmp_path)
    forged.json("bundle.json", lambda manifest: manifest.update(seeds=[1]))
    problems = forged.checked().problems
    assert "has seeds [1]; they must be 0, 1, 2" in problems[0]
    assert "holds seed0, which is not among the seeds" in problems[1]
    forged.json("bundle.json", lambda manifest: manifest.update(seeds=[0, 1, 2]))
    assert "seed2: lacks episodes.parquet" in forged.checked().problems[0]


def test_other_physics_are_refused(forged: Forgery):
    forged.json("bundle.json", lambda manifest: manifest.update(physics="0" * 64))
    assert forged.checked().problems == [
        "was played with other physics than this version's; submit it again with this version"
    ]
