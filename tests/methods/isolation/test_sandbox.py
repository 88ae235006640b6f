"""The sandbox's own folder is limited by the system, and nothing beside Python's own folders is in it."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.methods.agents import AgentCrashed
from dextron_bench.methods.isolation import sandbox
from dextron_bench.methods.isolation.isolated_agent import IsolatedAgent, Limits
from dextron_bench.methods.isolation.launch import prepare_launch

pytestmark = pytest.mark.skipif(not sandbox.is_available(), reason="bubblewrap is not installed")

PROGRAM = """
import json, mmap, os, socket, sys
print(json.dumps({{"protocol": json.loads(input())["protocol"]}}), flush=True)
input()
kept, left, right = [], *socket.socketpair()
{before}
for k in range(8):
    with open(str(k), "w+b") as file:
        file.write(b"x" * 2**22)
        file.flush()
        {after}
print(json.dumps({{"actions": [0.5]}}), flush=True)
input()
"""
DEEP = "for _ in range(2600):\n    os.mkdir('a')\n    os.chdir('a')"  # Longer than the longest path.
MAPPED = "kept.append(mmap.mmap(file.fileno(), 4096)); os.unlink(str(k))"
SENT = "socket.send_fds(left, [b'x'], [file.fileno()]); os.unlink(str(k))"


@pytest.mark.parametrize(("before", "after"), [(DEEP, "pass"), ("", MAPPED), ("", SENT)])
def test_files_that_cannot_be_seen_from_outside_are_limited_too(before: str, after: str, tmp_path: Path):
    (tmp_path / "agent.py").write_text(PROGRAM.format(before=before, after=after))
    launch = prepare_launch(f"exec:{shlex.quote(sys.executable)} {tmp_path}/agent.py")
    with IsolatedAgent(launch, limits=Limits(answer=200.0, start=200.0, disk=16 * 2**20)) as agent:
        with pytest.raises(AgentCrashed, match="No space left on device"):
            agent.act(np.zeros((1, 48)))
        folder = Path(agent._scratch.name)
        assert list(folder.iterdir()) == []
    assert not folder.exists()


@pytest.mark.parametrize("place", ["{prefix}/leaderboard/results", "/usr/src/dextron-bench", "/usr/local/src/runs"])
def test_a_project_inside_the_folder_of_python_is_not_in_the_sandbox(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """As after `python -m venv .` in the folder of the project."""
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    command = sandbox.wrap(["agent"], "/scratch", (), 2**30, 2**20, [Path(sandbox.__file__)])
    bound = [command[index + 1] for index, word in enumerate(command) if word in ("--bind", "--ro-bind-try")]
    assert {f"{tmp_path}/lib", "/usr/lib"} <= set(bound)
    hidden = Path(place.format(prefix=tmp_path))
    assert [folder for folder in bound if hidden.is_relative_to(folder)] == []


def test_a_link_in_the_folder_of_python_stays_a_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A second copy of `lib` would have the simulator, which is hidden in the first one."""
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib64").symlink_to("lib")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    command = sandbox.wrap(["agent"], "/scratch", (), 2**30, 2**20, [Path(sandbox.__file__)])
    assert command.count(f"{tmp_path}/lib64") == 1
    assert command[command.index(f"{tmp_path}/lib64") - 2 :][:2] == ["--symlink", str((tmp_path / "lib").resolve())]


def test_published_results_in_the_package_are_hidden_from_installed_methods(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A wheel has them as `data/results`: every setting of the splits, and the actions of `exp`."""
    assert "results".startswith(sandbox.SECRET)
    results, splits = tmp_path / "results", tmp_path / "splits.json"
    results.mkdir()
    splits.touch()
    monkeypatch.setattr(sandbox, "secret_files", lambda: [results, splits])
    command = sandbox.wrap(["agent"], "/scratch", (), 2**30, 2**20)
    assert command[command.index(str(results)) - 1] == "--tmpfs"
    assert command[command.index(str(splits)) - 1] == "/dev/null"


@pytest.mark.skipif(not Path("/bin/sh").exists(), reason="there is no shell that sets limits")
@pytest.mark.parametrize("outer", ["-d 3000000", "-f 1000", "-n 100"])
def test_a_lower_limit_of_the_user_stays_and_ends_nothing(outer: str):
    """A shell ends when it raises a hard limit, and with it the agent."""
    flag = outer.split()[0]
    command = f"ulimit {outer}; {sandbox.LIMITS}"
    shell = ["/bin/sh", "-c", command, "agent", "4194304", "524288", "/bin/sh", "-c", f"ulimit {flag}"]
    done = subprocess.run(shell, capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == (outer.split()[1], "")
