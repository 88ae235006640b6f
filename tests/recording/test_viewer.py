"""Errors before Rerun's viewer starts."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench import recording


def test_without_a_screen_the_native_viewer_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    file = tmp_path / "one.rrd"
    file.touch()
    with pytest.raises(
        recording.ViewerError, match="there is no screen for the native viewer; `view --web` and `browse --web`"
    ):
        recording.view([file])


def test_the_viewer_does_not_start_for_a_missing_recording(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="there is no recording"):
        recording.view([tmp_path / "none.rrd"])
