"""The command line on machines that lack something: no name of the user, no locks, no `fsync`, no links.

`tests.helpers.conditions` imitates them for all processes of a command.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from dextron_bench.cli import main
from dextron_bench.training.checkpoints import LOCK
from tests.helpers import conditions, tiny_benchmark, tiny_training
from tests.helpers.tiny_training import TOY

TRAIN = ("run", "--method", TOY, "--seed", "0", "--record", "0", "--quiet", "--split", "val")
SHARED = [
    ("no_flock", "no_links", "no_folder_fsync"),
    pytest.param(("no_fcntl", "no_fsync", "no_modes"), marks=pytest.mark.slow),
    pytest.param(("process_one", "no_name", "no_mmap"), marks=pytest.mark.slow),
]


def finish(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and stderr."""
    _, printed = process.communicate(timeout=300)
    return process.returncode, printed


@pytest.mark.slow
@pytest.mark.parametrize("names", SHARED, ids="+".join)
def test_a_training_ends_with_the_same_bytes(training_world: Path, names: tuple[str, ...]):
    assert main.main([*TRAIN, "--runs", "plain"]) == 0
    environment = conditions.environment(*names)
    assert finish(tiny_benchmark.start(training_world / "data", *TRAIN, **environment)) == (0, "")
    assert tiny_training.contents(Path("runs")) == tiny_training.contents(Path("plain"))
    assert not list(Path("runs").rglob(LOCK))


@pytest.mark.slow
def test_a_training_where_nothing_can_be_locked_says_so_in_one_line(training_world: Path):
    environment = conditions.environment("no_flock", "no_exclusive")
    code, printed = finish(tiny_benchmark.start(training_world / "data", *TRAIN, **environment))
    assert (code, printed.count("\n")) == (0, 1)
    assert "let no other process work in the same folder" in printed


@pytest.mark.slow
def test_a_training_in_a_folder_whose_holder_is_elsewhere_says_which_file_to_remove(training_world: Path):
    assert main.main([*TRAIN]) == 0
    lock = next(Path("runs").glob("*/synthetic/training-*")) / LOCK
    (lock.parent.parent / "seed0/weights.safetensors").unlink()
    lock.touch()
    code, printed = finish(tiny_benchmark.start(training_world / "data", *TRAIN, **conditions.environment("no_flock")))
    assert (code, printed.count("\n")) == (2, 1)
    assert f"lock file {lock}" in printed.replace(f"{training_world}/", "")
    assert "if that process has ended, remove the lock file" in printed


@pytest.mark.slow
def test_a_user_without_a_name_learns_where_imported_data_can_go(tmp_path: Path):
    for words in (["data", "info", "--reaches", "real"], ["data", "import", "--from", "~/release.zip"]):
        process = tiny_benchmark.start(tmp_path, *words, **conditions.environment("no_name"))
        code, printed = finish(process)
        assert (code, printed.count("\n")) == (2, 1)
        assert "home folder" in printed


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_is_named_with_the_flag(tiny_world: Path):
    Path("runs").mkdir(mode=0o500)
    code, printed = finish(tiny_benchmark.start(tiny_world / "data", "run", "--method", "nothing", "--quiet"))
    assert (code, printed.count("\n")) == (2, 1)
    assert "--runs chooses another place" in printed
