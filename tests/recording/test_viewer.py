"""Errors before Rerun's viewer starts."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench import recording


def test_the_viewer_does_not_start_for_a_missing_recording(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="there is no recording"):
        recording.view([tmp_path / "none.rrd"])
