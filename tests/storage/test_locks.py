"""One process holds a lock, on whatever file system; the lock of a process that was killed can be taken over."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dextron_bench.storage import locks
from tests.helpers import conditions

HOLDS = """
import sys
from pathlib import Path
from dextron_bench.storage import locks
with locks.held(Path(sys.argv[1])) as say:
    say("here")
    print("held", flush=True)
    sys.stdin.readline()
"""
COUNTS = """
import sys, time
from pathlib import Path
from dextron_bench.storage import locks
lock, counter = Path(sys.argv[1]), Path(sys.argv[2])
added = 0
while added < 25:
    try:
        with locks.held(lock):
            number = int(counter.read_text())
            time.sleep(0.001)
            counter.write_text(str(number + 1))
            added += 1
    except locks.Held:
        time.sleep(0.001)
"""
FILE_SYSTEMS = [(), ("no_flock",), ("no_fcntl",), ("no_flock", "no_links"), ("process_one", "no_flock")]
everywhere = pytest.mark.parametrize("names", FILE_SYSTEMS, ids=lambda names: "+".join(names) or "as here")


@contextmanager
def holder(file: Path, *names: str) -> Iterator[subprocess.Popen[str]]:
    """A process that holds a lock under conditions, until it receives a line."""
    command, environment = [sys.executable, "-c", HOLDS, str(file)], conditions.environment(*names)
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def take(file: Path, *names: str) -> str:
    """The last line on stderr of a process that takes a lock and gives it back; empty if it succeeds."""
    done = subprocess.run(
        [sys.executable, "-c", HOLDS, str(file)],
        env=conditions.environment(*names),
        input="\n",
        capture_output=True,
        text=True,
    )
    return done.stderr.strip().splitlines()[-1] if done.stderr else ""


@pytest.mark.slow
@everywhere
def test_one_process_holds_a_lock_and_others_learn_which(tmp_path: Path, names: tuple[str, ...]):
    file = tmp_path / ".locked"
    with holder(file, *names) as process:
        line = take(file, *names)
        assert f"lock file {file}: process {process.pid} on {platform.node()}, since 2" in line
        assert "remove" not in line  # It lives for certain.
        assert (locks.is_held(file), locks.text(file)) == (True, "here")
        process.communicate("\n")
        assert os.listdir(tmp_path) == []
    assert (locks.is_held(file), locks.text(file)) == (False, None)


@pytest.mark.slow
@everywhere
def test_the_lock_of_a_killed_process_is_taken_over(tmp_path: Path, names: tuple[str, ...]):
    file = tmp_path / ".locked"
    with holder(file, *names) as process:
        process.kill()
        process.wait()
        assert (locks.is_held(file), locks.text(file)) == (False, None)
        assert take(file, *names) == ""
    assert os.listdir(tmp_path) == []


def test_a_killed_process_whose_parent_has_not_noticed_holds_nothing(tmp_path: Path):
    file = tmp_path / ".locked"
    with holder(file, "no_flock") as process:
        process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # It has ended, and is still listed.
        assert not locks.is_held(file)


@pytest.mark.slow
@everywhere
def test_two_processes_never_hold_a_lock_at_the_same_time(tmp_path: Path, names: tuple[str, ...]):
    lock, counter = tmp_path / ".locked", tmp_path / "counter"
    counter.write_text("0")
    command = [sys.executable, "-c", COUNTS, str(lock), str(counter)]
    mixed = [subprocess.Popen(command, env=conditions.environment(*some)) for some in (names, names, ())]
    assert [process.wait() for process in mixed] == [0, 0, 0]
    assert counter.read_text() == "75"
    assert os.listdir(tmp_path) == ["counter"]


@pytest.mark.parametrize("changed", ["boot", "numbering"])
def test_the_end_of_a_process_elsewhere_is_not_certain(tmp_path: Path, changed: str):
    """The number of a process of another machine, or of another container, says nothing here."""
    file = tmp_path / ".locked"
    with holder(file, "no_flock") as process:
        process.kill()
        process.wait()
        record = json.loads(file.read_text().splitlines()[0])
        file.write_text(json.dumps(record | {changed: "another", "host": "node7"}) + "\n")
    assert locks.is_held(file)
    with pytest.raises(locks.Held) as caught, locks.held(file):
        pass
    assert str(caught.value) == (
        f"lock file {file}: process {process.pid} on node7, since {record['since']}; "
        "if that process has ended, remove the lock file"
    )


def test_the_lock_of_the_system_proves_the_end_of_a_process_elsewhere(tmp_path: Path):
    file = tmp_path / ".locked"
    with holder(file) as process:
        record = file.read_text().replace(locks._this_process().boot, "another")
        with file.open("r+") as content:
            content.write(record)
        assert "another" in file.read_text()
        assert locks.is_held(file)
        process.kill()
        process.wait()
    assert take(file) == ""


def test_a_process_that_has_the_number_of_an_ended_one_is_another_process(tmp_path: Path):
    file = tmp_path / ".locked"
    with holder(file, "no_flock"):
        record = json.loads(file.read_text().splitlines()[0])
        file.write_text(json.dumps(record | {"start": "1"}) + "\n")
        assert take(file) == ""


@pytest.mark.parametrize("content", ["", "{", "[]", '{"host": "a"}'])
def test_a_file_that_names_no_process_says_what_to_do(tmp_path: Path, content: str):
    file = tmp_path / ".locked"
    file.write_text(content)
    assert locks.is_held(file)
    with pytest.raises(locks.Held, match=r"it does not say by whom; if that process has ended, remove the lock file$"):
        locks.held(file).__enter__()
    file.unlink()
    with locks.held(file):
        pass
    assert os.listdir(tmp_path) == []


def test_a_lock_that_was_removed_by_hand_and_taken_stays_with_its_new_holder(tmp_path: Path):
    file = tmp_path / ".locked"
    with locks.held(file):
        file.unlink()
        second = locks.held(file)
        second.__enter__()
    assert locks.is_held(file)
    second.__exit__(None, None, None)
    assert not locks.is_held(file)


@pytest.mark.slow
@pytest.mark.parametrize("error", ["ENOSYS", "EOPNOTSUPP", "ENOLCK", "EINVAL"])
def test_every_answer_of_a_file_system_without_flock_is_understood(tmp_path: Path, error: str):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLOCK_ERROR", error)
        with holder(tmp_path / ".locked", "no_flock"):
            assert "process" in take(tmp_path / ".locked", "no_flock")


def test_without_any_lock_one_line_says_so_and_the_work_goes_on(tmp_path: Path):
    line = take(tmp_path / ".locked", "no_flock", "no_exclusive")
    assert line.endswith("let no other process work in the same folder")
    assert os.listdir(tmp_path) == []


def test_an_error_of_the_block_does_not_name_the_lock(tmp_path: Path):
    with pytest.raises(OSError, match="full") as caught, locks.held(tmp_path / ".locked"):
        raise OSError(28, "full")
    assert caught.value.filename is None
    assert os.listdir(tmp_path) == []
