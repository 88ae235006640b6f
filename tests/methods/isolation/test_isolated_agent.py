"""Isolated agents: they act as in this process, and a failure fails only the current episodes."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.methods.isolation.launch import prepare_launch
from tests.helpers.isolated_play import CASES, CLOSES, play
from tests.helpers.short_reaches import SOURCE


@pytest.mark.slow
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


def test_a_module_in_the_working_folder_plays_and_may_import_its_package(
    agent_spec: Callable[[str], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """It plays in another folder, from which the working folder is neither searched nor listed."""
    monkeypatch.chdir(tmp_path)
    package = tmp_path / "my_package"
    package.mkdir()
    (package / "distance.py").write_text("NEAR = 0.06\n")
    agent_spec(f"from my_package.distance import NEAR; {CLOSES.replace('0.06', 'NEAR')}")
    (tmp_path / "mine.py").rename(package / "agent.py")
    assert [episode.failure for episode in play("my_package.agent:Agent")] == [""] * 3


def test_a_file_may_hold_a_learner_and_its_agent(agent_spec: Callable[[str], str]):
    (episode,) = play(
        agent_spec("from dextron_bench.methods.learners import TrainingSetup; return np.zeros((len(states), 1))"),
        CASES[:1],
    )
    assert episode.failure == ""


def test_an_agent_may_import_the_public_names_of_policies(agent_spec: Callable[[str], str]):
    names = "Agent, Case, Expert, ExpertAgent, Learner, Perceptron, SuccessModel, Trainer, TrainingSetup"
    (episode,) = play(agent_spec(f"from dextron_bench import {names}; return np.zeros((len(states), 1))"), CASES[:1])
    assert episode.failure == ""


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
        play(f"exec:{shlex.quote(sys.executable)} {tmp_path}/agent.py")
    assert why in str(caught.value)


PROGRAM = """
import json, sys
print(json.dumps({"protocol": json.loads(input())["protocol"]}), flush=True)
for line in sys.stdin:
    print(json.dumps({"actions": [0.5 for _ in json.loads(line)["states"]]}), flush=True)
"""


def test_a_program_that_follows_the_protocol_plays(tmp_path: Path):
    (tmp_path / "agent.py").write_text(PROGRAM)
    for episode in play(f"exec:{shlex.quote(sys.executable)} {tmp_path}/agent.py"):
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
