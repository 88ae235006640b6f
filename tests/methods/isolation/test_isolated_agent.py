"""Isolated agents: they act as in this process, and forbidden or failing code fails only their episodes.

Long, because it lists what agents try, and what must happen each time.
"""

from __future__ import annotations

import socket
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import onnx.helper
import onnx.numpy_helper
import pytest
import torch

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.isolation import policy_files, sandbox
from dextron_bench.methods.isolation.isolated_agent import IsolatedAgent, Limits
from dextron_bench.methods.isolation.launch import NoSandbox, prepare_launch
from dextron_bench.splits.loading import cases_from_frame
from tests.helpers.short_reaches import SOURCE
from tests.helpers.tiny_benchmark import ROWS

CASES: list[Case] = cases_from_frame(ROWS[:3])
AGENT = """
import numpy as np
from dextron_bench.world import task

class Agent:
    name = "mine"

    def agent(self, seed):
        return self

    def reset(self, episodes):
        pass

    def act(self, states):
        {act}
"""
MEMORY = "MiB of memory, more than 768"
CLOSES = "return np.where(task.distance(states) < 0.06, 1.0, -1.0)[:, None]"


@pytest.fixture
def agent_spec(tmp_path: Path) -> Callable[[str], str]:
    """Writes an agent whose `act` is one line; returns its spec."""

    def write(act: str) -> str:
        file = tmp_path / "mine.py"
        file.write_text(AGENT.format(act=act))
        return f"{file}:Agent"

    return write


def play(spec: str, cases: list[Case] = CASES, **limits: float) -> list[Episode]:
    with IsolatedAgent(prepare_launch(spec, trust=True), limits=Limits(**limits)) as agent:  # pyright: ignore[reportArgumentType]
        episodes = dict(rollout(agent, SOURCE, cases, slots=2, threads=1))
    return [episodes[index] for index in range(len(cases))]


def test_an_isolated_agent_acts_as_in_this_process(agent_spec: Callable[[str], str]):
    class Here:
        def reset(self, episodes: np.ndarray) -> None: ...

        def act(self, states: np.ndarray) -> np.ndarray:
            from dextron_bench.world import task

            return np.where(task.distance(states) < 0.06, 1.0, -1.0)[:, None]

    here = dict(rollout(Here(), SOURCE, CASES, slots=2, threads=1))
    for index, episode in enumerate(play(agent_spec(CLOSES))):
        np.testing.assert_array_equal(episode.states, here[index].states)
        np.testing.assert_array_equal(episode.actions, here[index].actions)
        assert episode.score == here[index].score


def test_installed_methods_play_and_agents_may_print(agent_spec: Callable[[str], str]):
    assert [episode.failure for episode in play("nothing")] == [""] * 3
    assert [episode.failure for episode in play(agent_spec(f"print('hello'); {CLOSES}"))] == [""] * 3


def test_a_file_may_hold_a_learner_and_its_agent(agent_spec: Callable[[str], str]):
    (episode,) = play(
        agent_spec("from dextron_bench.methods.learners import Track; return np.zeros((len(states), 1))"), CASES[:1]
    )
    assert episode.failure == ""


def test_an_agent_may_import_the_public_names_of_policies(agent_spec: Callable[[str], str]):
    names = "Agent, Case, Expert, ExpertAgent, Learner, Perceptron, SuccessModel, Trainer, Track"
    (episode,) = play(agent_spec(f"from dextron_bench import {names}; return np.zeros((len(states), 1))"), CASES[:1])
    assert episode.failure == ""


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
        ("from dextron_bench.world import model; model.load()", "'NoneType' object is not callable"),
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


def test_an_agent_may_write_in_its_own_folder(agent_spec: Callable[[str], str]):
    act = f"open('note', 'w').write('x'); import os; os.remove('note'); {CLOSES}"
    assert [episode.failure for episode in play(agent_spec(act))] == [""] * 3


def test_nan_fails_one_episode_and_a_crash_fails_the_current_episodes(agent_spec: Callable[[str], str], tmp_path: Path):
    """With two slots the third episode begins after the crash, alone, in a new process."""
    nan = play(agent_spec("a = np.zeros((len(states), 1)); a[0] = np.nan; return a"), CASES[:2])
    assert [episode.failure for episode in nan] == ["action is nan at step 0", ""]
    spec, file = agent_spec(f"import os; self.begun == 2 and os._exit(1); {CLOSES}"), tmp_path / "mine.py"
    file.write_text(file.read_text().replace("pass", "self.begun = len(episodes)"))
    first, second, third = play(spec)
    assert first.failure == second.failure == "it ended with code 1 at step 0"
    assert third.failure == ""
    assert len(third.actions) > 10


def test_an_agent_that_uses_up_its_time_is_stopped(agent_spec: Callable[[str], str]):
    """Starting the process alone takes longer than a millisecond; with two slots the third episode comes after it."""
    first, second, third = play(agent_spec(CLOSES), total=0.001)
    assert first.failure == second.failure == "it has had the 0.001 s that all its answers may take at step 1"
    assert third.failure == "it has had the 0.001 s that all its answers may take at step 0"


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("exit()", "did not start: it ended with code 0"),
        ("print('hi', flush=True)", "instead of a JSON object on one line"),
        ("print('{}', flush=True)", 'its first line must be {"protocol": 1}'),
        ("print('x' * 10000, flush=True)", "its answer is longer than 4176 bytes"),
    ],
)
def test_a_program_that_does_not_follow_the_protocol_is_reported(tmp_path: Path, line: str, why: str):
    (tmp_path / "agent.py").write_text(f"input()\n{line}\ninput()\n")
    with pytest.raises(AgentError, match="the agent") as caught:
        play(f"exec:{sys.executable} {tmp_path}/agent.py")
    assert why in str(caught.value)


PROGRAM = """
import json, sys
print(json.dumps({"protocol": json.loads(input())["protocol"]}), flush=True)
for line in sys.stdin:
    print(json.dumps({"actions": [0.5 for _ in json.loads(line)["states"]]}), flush=True)
"""


def test_a_program_that_follows_the_protocol_plays(tmp_path: Path):
    (tmp_path / "agent.py").write_text(PROGRAM)
    for episode in play(f"exec:{sys.executable} {tmp_path}/agent.py"):
        assert episode.failure == ""
        assert (episode.actions == 0.5).all()


@pytest.mark.parametrize(
    ("spec", "why"),
    [("exec:agent 'x", "is not a command"), ("__main__:Agent", "agents cannot come from the module __main__")],
)
def test_a_text_that_names_no_agent_raises(spec: str, why: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", None)  # As in a program that is started from a file.
    with pytest.raises(AgentError, match=why):
        prepare_launch(spec)


def test_limits_are_positive():
    with pytest.raises(AgentError, match="--timeout and --memory are more than 0"):
        Limits(memory=-1)


def test_a_program_that_does_not_exist_is_named():
    with pytest.raises(AgentError, match=r"it ended with code 127: .*no-such-program"):
        play("exec:no-such-program")


def test_torchscript_policies_play_and_pickles_do_not(tmp_path: Path):
    class Constant(torch.nn.Module):
        def forward(self, states: torch.Tensor) -> torch.Tensor:
            return torch.tanh(states[:, :1] * 0.0 + 0.25)

    file = tmp_path / "policy.pt"
    torch.jit.save(torch.jit.script(Constant()), str(file))
    for episode in play(str(file), CASES[:1]):
        np.testing.assert_allclose(episode.actions, np.tanh(0.25), atol=1e-7)
    torch.save({"weights": 1}, file)
    with pytest.raises(AgentError, match="is not a TorchScript file"):
        play(str(file))
    with pytest.raises(policy_files.BadPolicy, match=r"file ends in \.pt or \.onnx"):
        policy_files.load(tmp_path / "policy.pkl")


class Writer(torch.nn.Module):
    """Writes a file through a memory map; the path is a constant of the graph."""

    def __init__(self, path: str) -> None:
        super().__init__()
        self.path = path

    def forward(self, states: torch.Tensor) -> torch.Tensor:
        stolen = torch.from_file(self.path, True, 10).fill_(1.0)
        return states[:, :1] * 0.0 + stolen[0] * 0.0


@pytest.fixture
def writer(tmp_path: Path) -> Path:
    """A TorchScript policy that writes the file `stolen` beside itself."""
    file = tmp_path / "policy.pt"
    torch.jit.save(torch.jit.script(Writer(str(tmp_path / "stolen"))), str(file))
    return file


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
bad = [n for n in seen if n.endswith((".parquet", "engine.py", "hand.xml", "splits.json")) and "pyarrow" not in n
       and "dextron" in n or "packages/mujoco/" in n or "libmujoco" in n or "packages/dm_control/" in n]
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


@pytest.mark.skipif(not sandbox.is_available(), reason="bubblewrap is not installed")
def test_torchscript_that_writes_files_writes_none_in_the_sandbox(writer: Path):
    (episode,) = play(str(writer), CASES[:1])
    assert "unable to open file" in episode.failure
    assert not writer.with_name("stolen").exists()


@pytest.mark.parametrize("name", ["policy.pt", "policy.onnx"])
def test_without_a_sandbox_no_policy_file_starts_unless_it_is_trusted(
    name: str, writer: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(sandbox, "is_available", lambda: False)
    file = writer.rename(writer.with_name(name))
    with pytest.raises(NoSandbox, match="add --trust"), IsolatedAgent(prepare_launch(str(file))) as agent:
        agent.act(np.zeros((1, 48)))
    assert not writer.with_name("stolen").exists()
    assert prepare_launch(str(file), trust=True).command_line("/", 2**30, 2**30)[0] != "bwrap"


def test_onnx_policies_play_and_other_files_do_not(tmp_path: Path):
    """The policy's action is -4 times the palm's x, clipped to [-1, 1]."""
    states = onnx.helper.make_tensor_value_info("states", onnx.TensorProto.FLOAT, ["N", 48])
    actions = onnx.helper.make_tensor_value_info("actions", onnx.TensorProto.FLOAT, ["N", 1])
    choice = onnx.numpy_helper.from_array(np.eye(48, 1, -7, dtype=np.float32) * np.float32(-4.0), "choice")
    bounds = [onnx.numpy_helper.from_array(np.array(end, np.float32), name) for name, end in (("low", -1), ("high", 1))]
    nodes = [
        onnx.helper.make_node("MatMul", ["states", "choice"], ["chosen"]),
        onnx.helper.make_node("Clip", ["chosen", "low", "high"], ["actions"]),
    ]
    graph = onnx.helper.make_graph(nodes, "policy", [states], [actions], [choice, *bounds])
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 18)], ir_version=10)
    file = tmp_path / "policy.onnx"
    onnx.save(model, str(file))
    for episode in play(str(file), CASES[:1]):
        seen = episode.states[: len(episode.actions), 7:8].astype(np.float32)
        expected = np.clip(np.float32(-4.0) * seen, -1.0, 1.0)
        assert len(np.unique(expected)) > 10
        np.testing.assert_array_equal(episode.actions, expected)
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(AgentError, match="is not an ONNX file that can be run"):
        play(str(file))
