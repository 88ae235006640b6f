"""Recordings of a submission that differ from its episodes are refused."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dextron_bench import recording
from dextron_bench.reaches import sources
from tests.helpers import tiny_benchmark
from tests.helpers.forged_bundles import Forgery


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_another_cause_is_refused_and_an_old_recording_without_one_is_not(forged: Forgery):
    file = forged.seed / "recordings" / "test-0000.rrd"
    recorded = recording.read(file)
    path = sources.open_source(tiny_benchmark.NAME).path(recorded.episode.setting)
    assert recorded.properties["cause"] != "slipped"
    recording.write(file, recorded.episode, path, {**recorded.properties, "cause": "slipped"})
    assert "recordings/test-0000.rrd says cause slipped, not" in forged.checked().problems[0]
    others = {name: value for name, value in recorded.properties.items() if name != "cause"}
    recording.write(file, recorded.episode, path, others)
    assert forged.checked().problems == []


def test_a_damaged_recording_is_refused(forged: Forgery):
    file = forged.seed / "recordings" / "test-0000.rrd"
    file.write_bytes(file.read_bytes()[:-100])
    assert "test-0000.rrd" in forged.checked().problems[0]
