"""Names of submissions: a name that equals or resembles another row's name is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench.leaderboard import add
from dextron_bench.leaderboard.submission import entry


@pytest.mark.parametrize(
    "name",
    ["exp", "Exp", "rlil-0.3", "RLIL-0.1-mine", "exp\n", "first", "FIRST", "rlil_0.1", "exp.", "F1RST", "f-irst"],
)
def test_names_that_equal_or_resemble_another_are_refused(name: str, tmp_path: Path):
    (tmp_path / "results" / "first" / "real" / "seed0").mkdir(parents=True)
    with pytest.raises(entry.BadSubmission):
        add.check_name(name, "synthetic", tmp_path, replace=True)
    add.check_name("first-of-mine", "synthetic", tmp_path, replace=False)
