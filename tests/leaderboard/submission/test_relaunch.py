"""Agents of submissions run again: from what their bundle brought, and from nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench.leaderboard.submission import playing, relaunch
from dextron_bench.leaderboard.submission.entry import MANIFEST_KINDS
from tests.helpers.forged_bundles import Forgery


def test_an_agent_that_did_not_play_these_episodes_is_caught(forged: Forgery):
    """Episodes of one agent, sent in with the code of another."""
    code = forged.folder / "agent" / "near.py"
    code.write_text(code.read_text().replace("1.0, -1.0", "0.9, -1.0"))
    assert forged.checked().sound
    problems = forged.checked(rerun=True).problems
    assert "the agent, run again, acts differently" in problems[0]


PARROT = """
import glob


class Near:
    name = "near"

    def __init__(self, near=0.06):
        pass

    def agent(self, seed):
        raise SystemExit(70 + len(glob.glob(__file__.rpartition("/agent/")[0] + "/seed*")))
"""


def test_an_agent_that_is_run_again_finds_nothing_to_repeat(forged: Forgery):
    """It ends with 70 and as many folders of episodes as it finds, or is stopped where it looks for them."""
    (forged.folder / "agent" / "near.py").write_text(PARROT)
    problems = forged.checked(rerun=True).problems
    assert "it ended with code 70" in problems[0] or "agents may not" in problems[0]


def test_an_agent_that_cannot_be_run_again_is_told(forged: Forgery):
    (forged.folder / "agent" / "near.py").unlink()
    assert "the bundle lacks the agent's file near.py" in forged.checked(rerun=True).problems[0]


@pytest.mark.parametrize(
    ("kind", "spec"),
    [
        ("method", "exec:/bin/sh -c id"),
        ("code", "exec:sh"),
        ("code", "/elsewhere/agent.py:Near"),
        ("code", "../agent.py:Near"),
        ("policy", "/elsewhere/policy.pt"),
        ("policy", "../policy.onnx"),
        ("method", "policy.pt"),
        ("method", "unknown"),
    ],
)
def test_a_manifest_starts_nothing_but_what_its_bundle_brought(
    kind: str, spec: str, forged: Forgery, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(playing, "IsolatedAgent", lambda *_: pytest.fail("an agent was started"))
    forged.json("bundle.json", lambda told: told["agent"].update(kind=kind, spec=spec))
    assert f"{spec!r} does not name an agent of kind {kind!r}" in forged.checked(rerun=True).problems[0]


@pytest.mark.parametrize(
    ("kind", "spec", "weights"),
    [
        ("method", "reflex", ""),
        ("method", "rlil", "seed0.safetensors"),
        ("code", "near.py:Near", ""),
        ("code", "baselines.reflex:Reflex", ""),
        ("policy", "policy.pt", ""),
        ("policy", "policy.onnx", ""),
    ],
)
def test_agents_of_each_kind_are_started_from_the_bundle(kind: str, spec: str, weights: str, tmp_path: Path):
    for name in ("near.py", "policy.pt", "policy.onnx", "seed0.safetensors"):
        (tmp_path / name).touch()
    told = {"kind": kind, "spec": spec, "settings": {}, "weights": weights}
    how = relaunch.launch_of(told, tmp_path)
    inside = kind == "policy" or ".py:" in spec
    assert (str(how.spec), how.command) == (f"{tmp_path}/{spec}" if inside else spec, ())
    assert MANIFEST_KINDS[how.spec.kind] == kind
    assert how.weights == (f"{tmp_path}/{weights}" if weights else "")


def test_weights_are_a_file_of_the_bundle(forged: Forgery):
    forged.json("bundle.json", lambda told: told["agent"].update(weights="../bundle.json"))
    assert "the bundle lacks the agent's file ../bundle.json" in forged.checked(rerun=True).problems[0]
