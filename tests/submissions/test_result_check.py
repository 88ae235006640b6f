"""Results of a submission must equal the result of its episodes; on another platform, their outcomes must agree."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from dextron_bench import recording
from dextron_bench.evaluation.episodes import fingerprint
from dextron_bench.reaches import sources
from dextron_bench.storage import provenance
from dextron_bench.submissions import result_check
from tests.helpers import tiny_benchmark
from tests.helpers.forged_bundles import Forgery, row


@pytest.mark.slow
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


def test_the_mean_returns_of_splits_that_were_played_are_compared():
    """A result of a stranger may have more splits than were played."""
    claimed = {"splits": {"test": {"scores": [20.0, 19.0]}, "train": {"scores": [20.0]}}}
    computed = {"splits": {"test": {"scores": [19.0, 19.0]}, "hard": {"scores": [0.0]}}}
    assert list(result_check.distant_returns(claimed, computed)) == [
        "its result has a mean return of 19.50 on test; played again it is 19.00"
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


def test_other_vector_extensions_make_another_platform():
    """A provenance that does not have them counts as before; nothing is excused for a machine that is no object."""
    here = provenance.collect("")
    here["machine"]["vector_extensions"] = ["sse4_2"]
    assert not result_check.same_platform(here)
    here["machine"]["vector_extensions"] = None
    assert result_check.same_platform(here)
    del here["machine"]["vector_extensions"]
    assert result_check.same_platform(here)
    assert result_check.same_platform({**here, "machine": []})


@pytest.mark.slow
def test_on_another_platform_only_outcomes_must_agree(forged: Forgery):
    """All episodes differ in the last bits; their outcomes equal the replay."""
    forged.json("seed0/provenance.json", lambda content: content["machine"].update(cpu="another"))
    assert forged.checked().problems == ["seed0: its result has another provenance than its run"]
    forged.json("seed0/result.json", lambda result: result["provenance"]["machine"].update(cpu="another"))
    forged.table(lambda table: table.assign(trace="0" * 64))
    verdict = forged.checked()
    assert verdict.problems == []
    assert "made on another platform; of 4 episodes 0 are equal bit for bit, 4 end alike" in verdict.notes[0]
    assert verdict.results[0]["replay"] == {"episodes": 4, "equal": 0}
    forged.table(row(2, score=20.0, success=True))
    assert "says success True" in "".join(forged.checked().problems)


def foreign(forged: Forgery) -> None:
    """Edits the bundle so that it counts as made on another platform; no hash of an episode is right."""
    forged.json("seed0/provenance.json", lambda content: content["machine"].update(cpu="another"))
    forged.json("seed0/result.json", lambda result: result["provenance"]["machine"].update(cpu="another"))
    forged.table(lambda table: table.assign(trace="0" * 64))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"method": "exp"}, "its result says method 'exp', not 'near'"),
        ({"seed": 7}, "its result says seed 7, not 0"),
        ({"declared": {"hours": 1}}, "its result has other declarations than its manifest"),
    ],
)
def test_another_platform_excuses_no_false_claim(changes: dict[str, Any], why: str, forged: Forgery):
    foreign(forged)
    forged.json("seed0/result.json", lambda result: result.update(changes))
    assert forged.checked().problems == [f"seed0: {why}"]


@pytest.mark.slow
def test_another_platform_excuses_no_false_scores(forged: Forgery):
    foreign(forged)
    forged.json("seed0/result.json", lambda result: result["splits"]["test"]["scores"].reverse())
    assert "its result has scores on test that its episodes do not give" in forged.checked().problems[0]
    forged.table(row(2, score=1.0))
    forged.conclude()
    assert "says return 1.0; played again it is 0.0" in "".join(forged.checked().problems)


def test_mean_returns_agree_on_every_split():
    """A few wrong episodes among a thousand can be most of a small split."""
    splits = [{name: {"scores": scores}} for name, scores in (("open", [1.0, 0.0]), ("open", [0.5, 0.0]))]
    lines = list(result_check.distant_returns({"splits": splits[0]}, {"splits": splits[1]}))
    assert lines == ["its result has a mean return of 0.50 on open; played again it is 0.25"]
    assert not list(result_check.distant_returns({"splits": splits[0]}, {"splits": splits[0]}))


@pytest.mark.slow
def test_another_platform_excuses_no_forged_recording(forged: Forgery):
    """The table has the hash of the forged recording."""
    foreign(forged)
    file = forged.seed / "recordings" / "test-0000.rrd"
    recorded = recording.read(file)
    path = sources.open_source(tiny_benchmark.NAME).path(recorded.episode.setting)
    for distance, problems in ((1e-9, 0), (0.01, 1)):
        states = recorded.episode.states.copy()
        states[5, 2] += distance
        changed = replace(recorded.episode, states=states)
        recording.write(file, changed, path, recorded.properties)
        forged.table(row(0, trace=fingerprint(changed)))
        assert len(forged.checked().problems) == problems


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [{"machine": "x"}, {"git": ["a"]}, {"machine": {"system": "Linux", "cpu": "\ud800", "cores": 1}}, {"more": 1}],
)
def test_a_provenance_that_would_break_the_page_is_refused(changes: dict[str, Any], forged: Forgery):
    forged.json("seed0/provenance.json", lambda content: content.update(changes))
    forged.json("seed0/result.json", lambda result: result["provenance"].update(changes))
    assert "in the result is invalid" in forged.checked().problems[0] or "text" in forged.checked().problems[0]
