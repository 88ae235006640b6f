"""What agents try: forbidden and failing code fails its episodes, with and without the hook and the sandbox."""

from __future__ import annotations

import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from dextron_bench.methods.isolation import sandbox
from tests.helpers.isolated_play import CASES, play

MEMORY = "MiB of memory, more than 768"


@pytest.mark.parametrize(
    ("act", "why"),
    [
        ("from dextron_bench.world.engine import Engine", "agents may not import dextron_bench.world.engine"),
        ("from dextron_bench import splits", "agents may not import dextron_bench.splits"),
        ("from dextron_bench import rollout", "agents may not import dextron_bench.evaluation"),
        ("import dextron_bench; dextron_bench.load_split", "agents may not import dextron_bench.splits"),
        ("import mujoco", "agents may not import mujoco"),
        ("import importlib; importlib.import_module('mujoco')", "agents may not import mujoco,"),
        ("from dextron_bench import Setting", "agents may not import dextron_bench.reaches.setting"),
        ("from dextron_bench.world import model; model.load()", "agents may not import dextron_bench.world.simulator"),
        ("import dextron_bench as d; open(d.__path__[0] + '/data/splits.json')", "settings and experts are not for"),
        ("open('/etc/../root/.bashrc')", "may read only Python's files and their own folder"),
        ("open(__file__, 'a')", "may write only in the folder that they start in"),
        ("import os; os.remove(__file__)", "agents may not change files outside the folder"),
        ("import socket; socket.create_connection(('127.0.0.1', 9))", "agents may not use the network"),
        ("import subprocess; subprocess.run(['ls'])", "agents may not start or signal processes"),
        ("import os; os.kill(os.getppid(), 9)", "agents may not start or signal processes"),
        ("import sqlite3; sqlite3.connect('file:/tmp/mine?mode=rwc', uri=True)", "agents may not open databases"),
        (
            "import os, dextron_bench as d; os.open(d.__path__[0] + '/data', 0)",
            "agents may not open the folder",
        ),
        ("import gc; gc.get_objects()", "agents may not search the process"),
        ("return np.ones((1, 1, 1))", "act() must return floats of shape (2, 1)"),
        ("return np.ones((len(states), 1), int)", "it returned int64"),
        ("import os; os._exit(7)", "it ended with code 7"),
        ("import os, signal; signal.raise_signal(9)", "it ended with signal SIGKILL"),
        ("return np.zeros((2, 10**9))[:, :1]", "Unable to allocate"),
        ("open('big', 'wb').truncate(2**30)", "File too large"),
        ("import os; os.rename(__file__, 'mine')", "agents may not change files outside the folder"),
        ("open('a', 'w').close(); import os; os.rename('a', '/tmp/stolen')", "agents may not change files outside"),
        ("import os; os.symlink('/etc', '/tmp/mine')", "agents may not change files outside the folder"),
        ("import shutil, os; shutil.rmtree(os.path.dirname(__file__))", "agents may not change files outside"),
        ("import os; os.listdir('/root')", "may read only Python's files and their own folder"),
        ("import resource; resource.prlimit(1, resource.RLIMIT_CORE)", "agents may not search the process"),
        ("raise ValueError('lost')", "ValueError: lost"),
        ("while True: pass", "it gave no answer within 1 s"),
    ],
)
def test_failing_or_forbidden_code_fails_its_episodes_and_is_named(
    act: str, why: str, agent_spec: Callable[[str], str]
):
    for episode in play(agent_spec(act), CASES[:2], answer=1.0 if "while" in act else 20.0):
        assert episode.score == 0.0
        assert why in episode.failure
        assert episode.failure.endswith(" at step 0")


@pytest.mark.slow
@pytest.mark.skipif(not sandbox.is_available(), reason="bubblewrap is not installed")
@pytest.mark.parametrize(
    "attempt",
    [
        "open('{data}/splits.json').read(1)",
        "open('{data}/experts-real.parquet', 'rb').read(1)",
        "open('{beside}', 'w').write('x') and 0",
        "os.listdir('{home}')",
        "os.kill(int(open('/proc/self/stat').read().split()[3]), 0) or os.getppid() > 5",
        "__import__('socket').create_connection(('127.0.0.1', {port}), 1)",
        "__import__('shutil').rmtree('{package}') or 1",
    ],
)
def test_the_sandbox_stops_agents_that_disable_the_hook(attempt: str, agent_spec: Callable[[str], str], tmp_path: Path):
    """The agent disables the hook, and its action says whether the attempt succeeded."""
    package = Path(sandbox.__file__).parents[2]
    with socket.create_server(("127.0.0.1", 0)) as server:
        beside = tmp_path / "beside"
        paths = {"data": package / "data", "package": package, "beside": beside, "home": Path(__file__).parent}
        code = attempt.format(**paths, port=server.getsockname()[1])
        act = f"""
        from dextron_bench.methods.isolation import guard
        guard._Guard.__call__ = lambda *_: None
        import os
        try:
            succeeded = bool({code})
        except Exception:
            succeeded = False
        return np.full((len(states), 1), 1.0 if succeeded else -1.0)"""
        (episode,) = play(agent_spec(act.strip()), CASES[:1])
        assert episode.failure == ""
        assert (episode.actions == -1.0).all()
        assert not beside.exists()
    assert (package / "data" / "splits.json").exists()


@pytest.mark.parametrize(
    ("act", "why"),
    [
        (
            "import mmap; self.m = [mmap.mmap(-1, 2**27) for _ in range(8)]; [m.write(b'x' * 2**27) for m in self.m]",
            MEMORY,
        ),
        (
            "import os; self.f = [os.memfd_create('m') for _ in range(8)]; [os.write(f, b'x' * 2**27) for f in self.f]",
            MEMORY,
        ),
    ],
)
def test_memory_that_is_shared_ends_the_agent(act: str, why: str, agent_spec: Callable[[str], str]):
    limits = {"answer": 30.0, "memory": 768 * 2**20}
    (episode,) = play(agent_spec(f"{act}; import time; time.sleep(20)"), CASES[:1], **limits)
    assert why in episode.failure


@pytest.mark.slow
def test_without_a_sandbox_the_size_of_files_is_measured(
    agent_spec: Callable[[str], str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(sandbox, "is_available", lambda: False)
    act = "[open(str(k), 'wb').write(b'x' * 2**25) for k in range(16)]; import time; time.sleep(20)"
    (episode,) = play(agent_spec(act), CASES[:1], answer=30.0, disk=256 * 2**20)
    assert "MiB of files, more than 256" in episode.failure


@pytest.mark.skipif(not sandbox.is_available(), reason="bubblewrap is not installed")
def test_the_sandbox_has_no_simulator_no_splits_and_no_folder_to_write_in(
    agent_spec: Callable[[str], str], tmp_path: Path
):
    """The agent walks all files that it can see from a child process, which no hook watches, and reports them."""
    probe = """
import importlib.util, os, sys
seen = [os.path.join(f, n) for top in sys.path + ["/tmp", {package!r}] for f, _, ns in os.walk(top) for n in ns]
ours = ({package!r} + "/", *(os.path.join(top, "dextron_bench/") for top in sys.path))
bad = [n for n in seen if n.endswith((".parquet", "engine.py", "hand.xml", "splits.json")) and n.startswith(ours)
       or "packages/mujoco/" in n or "libmujoco" in n or "packages/dm_control/" in n]
for place in ["/", "/tmp", "/dev/shm", {package!r}, "/usr", "/var"]:
    try:
        open(os.path.join(place, "written"), "w").close()
        bad.append("wrote in " + place)
    except OSError:
        pass
spec = importlib.util.find_spec("mujoco")
print(len(seen) > 1000, bad[:3], spec and spec.origin)
print([line.split()[1] for line in open("/proc/self/status") if line.startswith("CapEff")])
""".format(package=str(Path(sandbox.__file__).parents[2]))
    act = f"""
        from multiprocessing.util import spawnv_passfds
        import os, sys
        from dextron_bench.methods.isolation import guard
        guard._Guard.__call__ = lambda *_: None
        open("probe.py", "w").write({probe!r})
        import subprocess
        done = subprocess.run([sys.executable, "probe.py"], capture_output=True, text=True)
        raise ValueError(" ".join(done.stdout.split()) + done.stderr.strip()[-200:])"""
    (episode,) = play(agent_spec(act.strip()), CASES[:1])
    assert "ValueError: True [] None ['0000000000000000']" in episode.failure
