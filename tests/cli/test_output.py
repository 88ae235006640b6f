"""What commands print: progress on stderr, and tables that fit the terminal."""

from __future__ import annotations

import re
import sys
import time

import pytest

from dextron_bench.cli.support import output


class Terminal:
    """Replaces a terminal."""

    def __init__(self) -> None:
        self.text = ""

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        self.text += text
        return len(text)

    def flush(self) -> None: ...


def test_a_bar_shows_count_rate_and_time_left(monkeypatch: pytest.MonkeyPatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", "1")
    with output.progress_bar("rows") as progress:
        progress(100, 400)  # Work of an earlier run must not count for the rate.
        for done in (110, 120, 130):
            time.sleep(0.1)
            progress(done, 400)
    last = terminal.text.split("\r")[-1]
    assert "130/400" in last
    rate = float(last.split("/s")[0].split()[-1])
    assert 20 < rate < 130  # 10 each 0.1 s or a little more.
    assert "left" in last


def test_no_bar_appears_without_a_terminal_or_when_quiet(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    with output.progress_bar("rows") as progress:
        progress(1, 2)
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with output.progress_bar("rows", quiet=True) as progress:
        progress(1, 2)
    assert terminal.text == ""
    monkeypatch.undo()
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(("speed", "text"), [(None, ""), (0.0123, "0.012/s"), (4.56, "4.6/s"), (1234.5, "1234/s")])
def test_rates_are_short(speed: float | None, text: str):
    assert output._rate(speed) == text


def test_without_a_terminal_a_line_each_minute_says_what_is_done_and_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    """100 of 400 were done before; then 20 in the first two minutes: 10 a minute, so 280 take 28 minutes."""
    now = 1000.0
    monkeypatch.setattr(output.time, "monotonic", lambda: now)
    with output.progress_bar("rows") as progress:
        progress(100, 400)
        for at, done in (*((1030.0, 105), (1059.0, 109), (1120.0, 120)), *((1150.0, 125), (1180.0, 130))):
            now = at
            progress(done, 400, "val 3.1")
        for at, done in ((1250.0, 0), (1310.0, 60), (1600.0, 420)):  # Other work begins, and does more than it was to.
            now = at
            progress(done, 400)
    assert capsys.readouterr() == (
        "",
        "rows: 120/400, 0.17/s, 28 min left, val 3.1\nrows: 130/400, 0.17/s, 27 min left, val 3.1\n"
        "rows: 0/400\nrows: 60/400, 1/s, 5 min left\nrows: 420/400, 1.2/s, 0 s left\n",
    )


def test_short_pieces_of_work_have_a_line_each_minute_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    """Four bars of 25 s each: the third begins 50 s after the first, and prints at 75 s."""
    now = 1000.0
    monkeypatch.setattr(output.time, "monotonic", lambda: now)
    for bar in range(4):
        with output.progress_bar(f"piece {bar}") as progress:
            progress(0, 10)
            now += 25.0
            progress(10, 10)
    assert capsys.readouterr().err == "piece 2: 10/10, 0.4/s, 0 s left\n"


def test_a_duration_has_two_units_at_most():
    assert [output._duration(seconds) for seconds in (59.4, 61.0, 7320.0)] == ["59 s", "1 min", "2 h 2 min"]


def test_a_warning_is_one_short_line_without_control_characters(capsys: pytest.CaptureFixture[str]):
    output.print_warning("runs/\x1b[2J.rrd: damaged\n" + "x" * 5000)
    printed = capsys.readouterr().err
    assert printed.startswith("dextron-bench: runs/\\x1b[2J.rrd: damaged\\nxxx")
    assert printed.endswith("x... and 3023 more characters\n")
    assert printed.count("\n") == 1


@pytest.mark.parametrize(
    ("columns", "names", "line"),
    [
        ("60", ["method", "return", "regret", "seeds"], ""),
        ("30", ["method", "return", "seeds"], "a wider terminal also shows: regret"),
        ("22", ["method", "return"], "a wider terminal also shows: regret, seeds"),
    ],
)
def test_a_narrow_terminal_leaves_out_optional_columns_and_says_which(
    columns: str, names: list[str], line: str, monkeypatch: pytest.MonkeyPatch
):
    """With its frame, a column takes three characters more than its longest cell, and the table one more."""
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", "1")
    output.print_table("t", ["method", "return", "regret", "seeds"], [["exp", "20.00", "0.00", 3]], ("regret", "seeds"))
    heading = next(text for text in terminal.text.splitlines() if "method" in text)
    assert re.findall("method|return|regret|seeds", heading) == names
    assert terminal.text.splitlines()[-1].startswith(line or "└")
