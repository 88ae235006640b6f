"""Progress on stderr: what a bar shows, and when no bar appears."""

from __future__ import annotations

import sys
import time

import pytest

from dextron_bench.cli import output


class Terminal:
    """Replaces a terminal on stderr."""

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
