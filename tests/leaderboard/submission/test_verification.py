"""Verification accepts valid submissions, and refuses every forgery of the documented attacks with a reason."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dextron_bench import recording
from dextron_bench.leaderboard.submission import entry as submission_entry
from dextron_bench.leaderboard.submission import playing, result_check
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.reaches import sources
from dextron_bench.splits.loading import Split, cases_from_frame
from dextron_bench.storage import provenance
from tests.helpers import tiny_benchmark
from tests.helpers.forged_bundles import Forgery, row


def test_a_valid_submission_is_replayed_bit_for_bit_and_its_agent_run_again(forged: Forgery):
    """One of the four episodes of each seed knocks the bottle over."""
    verdict = forged.checked(rerun=True)
    assert verdict.problems == []
    assert verdict.notes[-1] == "all seeds have the same episodes: they count as one, not as several trainings"
    assert (verdict.tier, verdict.episodes, verdict.exact) == ("re-run", 8, 8)
    assert verdict.results[0]["splits"]["test"]["scores"] == [20.0, 20.0, 0.0]


def test_equal_submissions_have_equal_bytes_and_nothing_is_played_twice(submitted: Path, tmp_path: Path):
    entry = submission_entry.Entry("near", f"{submitted}/near.py:Near", tiny_benchmark.NAME, (0, 1))

    def forbidden(*_: object) -> None:
        raise AssertionError("played again")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(playing, "play_shuffled", forbidden)
        folder = playing.play_entry(entry, submitted / "runs", 1, Limits(), threads=1)
    playing.write_bundle(entry, folder, tmp_path / "again.zip")
    assert (tmp_path / "again.zip").read_bytes() == (submitted / "near.zip").read_bytes()


def test_episodes_are_played_in_an_order_that_depends_on_split_and_seed():
    split = Split("test", "synthetic", tuple(cases_from_frame(tiny_benchmark.ROWS)) * 20, "0" * 64)
    first, second = playing.row_order(split, 0), playing.row_order(split, 1)
    assert sorted(first) == list(range(len(split.cases)))
    assert list(first) != list(range(len(first)))
    assert list(first) != list(second)
    assert list(playing.row_order(replace(split, digest="1" * 64), 0)) != list(first)


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


def test_invalid_or_missing_actions_are_refused(forged: Forgery):
    forged.table(row(0, actions=np.array([2.0])))
    assert "row 0 has actions that are not" in forged.checked().problems[0]
    forged.table(row(0, actions=np.zeros(3), length=3))
    forged.conclude()
    assert "played again it is" in "".join(forged.checked().problems)


def test_a_changed_state_is_refused_although_the_hash_is_correct(forged: Forgery):
    file = forged.seed / "recordings" / "test-0000.rrd"
    recorded = recording.read(file)
    states = recorded.episode.states.copy()
    states[5, 2] += 1e-9
    source = sources.open_source(tiny_benchmark.NAME)
    changed = replace(recorded.episode, states=states)
    recording.write(file, changed, source.path(changed.setting), recorded.properties)
    assert forged.checked().problems == [
        "seed0: recordings/test-0000.rrd does not hold the episode that its actions give"
    ]


def test_a_recording_under_another_name_is_refused(forged: Forgery):
    file = forged.seed / "recordings" / "test-0000.rrd"
    recorded = recording.read(file)
    path = sources.open_source(tiny_benchmark.NAME).path(recorded.episode.setting)
    recording.write(file, recorded.episode, path, {**recorded.properties, "method": "other"})
    assert forged.checked().problems == ["seed0: recordings/test-0000.rrd says method other, not near"]
    file.rename(file.with_name("test-0001.rrd"))
    assert "test-0001.rrd does not hold the episode" in forged.checked().problems[0]
    file.with_name("test-0001.rrd").rename(file.with_name("test-0900.rrd"))
    assert "test-0900.rrd belongs to no row of the splits" in forged.checked().problems[0]


def test_a_damaged_recording_is_refused(forged: Forgery):
    file = forged.seed / "recordings" / "test-0000.rrd"
    file.write_bytes(file.read_bytes()[:-100])
    assert "test-0000.rrd" in forged.checked().problems[0]


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


def test_an_edited_result_is_refused(forged: Forgery):
    def better(result: dict[str, Any]) -> None:
        result["splits"]["test"]["scores"][2] = 20.0

    forged.json("seed0/result.json", better)
    assert forged.checked().problems == [
        "seed0: its result has scores on test that its episodes do not give (row 2: 20.0, not 0.0)"
    ]
    forged.json("seed0/result.json", lambda result: result.update(seed=7))
    assert "its result says seed 7, not 0" in forged.checked().problems[0]
    forged.json("seed0/result.json", lambda result: result.update(rank=1))
    assert "'rank' was unexpected" in forged.checked().problems[0]


def test_a_tier_cannot_be_claimed(forged: Forgery):
    forged.json("seed0/result.json", lambda result: result.update(tier="re-run"))
    verdict = forged.checked()
    assert verdict.tier == "replayed"
    assert "tier" not in verdict.results[0]


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


def test_chosen_and_hidden_seeds_are_refused(forged: Forgery):
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


def test_a_machine_has_the_same_platform_as_itself(monkeypatch: pytest.MonkeyPatch):
    """The name of macOS has two forms."""
    monkeypatch.setattr("platform.platform", lambda *_: "macOS-14.5-arm64")
    monkeypatch.setattr("platform.system", lambda: "Darwin")
    assert result_check.same_platform(provenance.collect(""))
    monkeypatch.setattr("platform.platform", lambda *_: "Linux-6.1-x86_64")
    here = provenance.collect("")
    monkeypatch.setattr("platform.platform", lambda *_: "macOS-14.5-arm64")
    assert not result_check.same_platform(here)


def test_on_another_platform_only_outcomes_must_agree(forged: Forgery):
    """All episodes differ in the last bits; their outcomes equal the replay."""
    forged.json("seed0/provenance.json", lambda content: content["machine"].update(cpu="another"))
    assert forged.checked().problems == ["seed0: its result has another provenance than its run"]
    forged.json("seed0/result.json", lambda result: result["provenance"]["machine"].update(cpu="another"))
    forged.table(lambda table: table.assign(trace="0" * 64))
    verdict = forged.checked()
    assert verdict.problems == []
    assert "made on another platform; of 4 episodes 0 are equal bit for bit, 4 end alike" in verdict.notes[0]
    forged.table(row(2, score=20.0, success=True))
    assert "says success True" in "".join(forged.checked().problems)


@pytest.mark.parametrize(
    "changes",
    [{"machine": "x"}, {"git": ["a"]}, {"machine": {"system": "Linux", "cpu": "\ud800", "cores": 1}}, {"more": 1}],
)
def test_a_provenance_that_would_break_the_page_is_refused(changes: dict[str, Any], forged: Forgery):
    forged.json("seed0/provenance.json", lambda content: content.update(changes))
    forged.json("seed0/result.json", lambda result: result["provenance"].update(changes))
    assert "in the result is invalid" in forged.checked().problems[0] or "text" in forged.checked().problems[0]
