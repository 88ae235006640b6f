"""The parser of recordings: its results for valid files, and its errors for all others."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dextron_bench.reaches.recorded import parsing
from tests.helpers.small_release import START, SmallRelease

FILE, NOTES = "extracts/01_fl_06.json", "extracts/meta/01_fl_06_meta.json"
GOOD = [["start", 0.0], ["reached", 1.0], ["top", 2.0]]

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["t", "x", "q", "z"]), inner),
    max_leaves=12,
)


def sample_line(t: Any = 1.0, x: Any = (0.0, 0.0, 0.0), q: Any = (1.0, 0.0, 0.0, 0.0)) -> str:
    return json.dumps({"t": t, "x": x, "q": q})


def test_parse_starts_the_clock_at_zero_and_measures_heights_from_the_table(small_release: SmallRelease):
    reach = parsing.parse("01_fl_06", small_release.files[FILE], small_release.files[NOTES])
    np.testing.assert_allclose(reach.times, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5], atol=1e-12)
    np.testing.assert_allclose(reach.positions[0], [-0.5, -0.2, 0.1])  # -0.1 m above a plane at 0.2 m.
    assert reach.reached == pytest.approx(0.3)
    assert (reach.subject, reach.ring, reach.angle) == ("01", 1, 1)


def test_reached_is_measured_from_the_first_sample_and_not_from_the_start_annotation(small_release: SmallRelease):
    notes = json.dumps([["start", START - 0.2], ["reached", START + 0.4], ["top", START + 0.5]]).encode()
    assert parsing.parse("01_fl_06", small_release.files[FILE], notes).reached == pytest.approx(0.4)


def test_a_sample_that_is_sent_twice_counts_once(small_release: SmallRelease):
    lines = small_release.files[FILE].splitlines(keepends=True)
    reach = parsing.parse("01_fl_06", b"".join([*lines[:2], lines[1], *lines[2:]]), small_release.files[NOTES])
    assert len(reach.times) == 6


@pytest.mark.parametrize(
    ("name", "expected"), [("01_fl_01", ("01", 0, 0)), ("09_nr_04", ("09", 0, 3)), ("02_fr_13", ("02", 3, 0))]
)
def test_markers_are_numbered_by_ring_and_then_by_angle(name: str, expected: tuple[str, int, int]):
    assert parsing.subject_and_region(name) == expected


@pytest.mark.parametrize("name", ["01_fl_17", "01_fl_00", "1_fl_01", "01_xx_01", "../01_fl_01", ""])
def test_other_names_are_refused(name: str):
    with pytest.raises(parsing.RecordingError, match="SUBJECT_TRIAL_MARKER"):
        parsing.subject_and_region(name)


@pytest.mark.parametrize(
    ("second", "reason"),
    [
        (sample_line(t=0.5), "time goes back from 1.0 to 0.5 s"),
        (sample_line(x=[0.0, 0.0]), "'x' is not 3 numbers"),
        (sample_line(q=[1.0, 0.0, 0.0]), "'q' is not 4 numbers"),
        (sample_line(q=[0.0, 0.0, 0.0, 0.0]), "'q' is not of unit length"),
        (sample_line(x=[0.0, float("nan"), 0.0]), "'x' holds nan, not a finite number"),
        (sample_line(t=float("inf")), "'t' holds inf, not a finite number"),
        (sample_line(t=True), "'t' holds a bool, not a number"),
        (sample_line(x=[0.0, "1", 0.0]), "'x' holds a str, not a number"),
        ('{"t": 1.0, "x": [0.0, 0.0, 0.0]}', "'q' is missing"),
        (sample_line()[:-4], "is not JSON, or is truncated"),
        ("", "is not JSON, or is truncated"),
        ("[1]", "is not an object with t, x and q"),
        ("[" * 5000, "is not JSON, or is truncated"),
    ],
)
def test_the_error_for_an_invalid_sample_names_its_line(second: str, reason: str):
    with pytest.raises(parsing.RecordingError) as caught:
        parsing.read_samples(FILE, f"{sample_line()}\n{second}\n{sample_line(t=2.0)}\n".encode())
    assert str(caught.value).startswith(f"{FILE}: line 2: ")
    assert reason in str(caught.value)


def test_the_error_for_bytes_that_are_not_text_names_their_line():
    with pytest.raises(parsing.RecordingError, match="line 2: is not UTF-8"):
        parsing.read_samples(FILE, sample_line().encode() + b"\n\xff\xfe\n")


def test_an_empty_file_is_an_error():
    with pytest.raises(parsing.RecordingError, match="line 1: the file is empty"):
        parsing.read_samples(FILE, b"")


@pytest.mark.parametrize(
    ("notes", "reason"),
    [
        (GOOD[:2], "annotation 'top' is missing"),
        ([GOOD[0], *GOOD], "annotation 'start' occurs twice"),
        ([["start", None], *GOOD[1:]], "'start' holds a NoneType, not a number"),
        ([["start"], *GOOD[1:]], r"entry 1 is not \[name, seconds\]"),
        ({"start": 0.0}, "is not a list"),
    ],
)
def test_the_error_for_invalid_annotations_has_the_reason(notes: Any, reason: str):
    with pytest.raises(parsing.RecordingError, match=f"{NOTES}: line 1: .*{reason}"):
        parsing.read_annotations(NOTES, json.dumps(notes).encode())


def test_the_annotation_rest_may_occur_twice():
    notes = json.dumps([*GOOD, ["rest", 3.0], ["rest", 4.0]]).encode()
    assert parsing.read_annotations(NOTES, notes)["reached"] == 1.0


def test_reached_outside_the_recording_is_an_error(small_release: SmallRelease):
    notes = json.dumps([["start", START], ["reached", START + 0.6], ["top", START + 0.7]]).encode()
    with pytest.raises(parsing.RecordingError, match=r"'reached' is outside the recording, 0\.600 s"):
        parsing.parse("01_fl_06", small_release.files[FILE], notes)


def test_too_few_samples_are_an_error(small_release: SmallRelease):
    three = b"".join(small_release.files[FILE].splitlines(keepends=True)[:3])
    with pytest.raises(parsing.RecordingError, match="has 3 samples"):
        parsing.parse("01_fl_06", three, small_release.files[NOTES])


@given(st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 4), min_size=1, max_size=20))
def test_numbers_are_read_exactly(rows: list[tuple[float, float, float, float]]):
    rows = sorted(rows)
    text = "\n".join(sample_line(t=t, x=x) for t, *x in rows)
    np.testing.assert_array_equal(parsing.read_samples(FILE, text.encode())[:, :4], rows)


@given(st.lists(json_values.map(json.dumps) | st.text(max_size=20), max_size=4).map("\n".join))
def test_any_text_is_refused_or_valid(text: str):
    assert_refused_or_valid(text.encode())


@settings(max_examples=200)
@given(st.integers(0, 200), st.binary(max_size=3), st.integers(0, 3))
def test_a_damaged_file_is_refused_or_valid(place: int, inserted: bytes, dropped: int):
    content = "\n".join(sample_line(t=float(t)) for t in range(3)).encode()
    assert_refused_or_valid(content[:place] + inserted + content[place + dropped :])


def assert_refused_or_valid(content: bytes) -> None:
    """Asserts that a file of samples has either finite rows in order of time, or an error with its line."""
    table = None
    with suppressed_at(f"{FILE}: line "):
        table = parsing.read_samples(FILE, content)
    if table is None:
        return
    assert table.shape[1] == 8
    assert np.all(np.isfinite(table))
    assert np.all(np.diff(table[:, 0]) >= 0)


@given(json_values.map(json.dumps) | st.text(max_size=30))
def test_any_annotations_are_refused_or_valid(text: str):
    times = None
    with suppressed_at(f"{NOTES}: line 1: "):
        times = parsing.read_annotations(NOTES, text.encode())
    assert times is None or set(parsing.ANNOTATIONS) <= set(times)


@contextmanager
def suppressed_at(place: str) -> Iterator[None]:
    """Suppresses a RecordingError whose message begins with a place; raises any other error."""
    try:
        yield
    except parsing.RecordingError as error:
        if not str(error).startswith(place):
            raise
