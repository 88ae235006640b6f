"""Agents of submissions run again from the files of their bundle alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench.submissions import playing, relaunch
from dextron_bench.submissions.entry import MANIFEST_KINDS
from tests.helpers.forged_bundles import Forgery


@pytest.mark.slow
def test_an_agent_that_did_not_play_these_episodes_is_refused(forged: Forgery):
    """The bundle has episodes of one agent and the code of another."""
    code = forged.folder / "agent" / "near.py"
    code.write_text(code.read_text().replace("1.0, -1.0", "0.9, -1.0"))
    assert forged.checked().passed
    problems = forged.checked(rerun=True, trust=True).problems
    assert "the agent, run again, acts differently" in problems[0]


SEARCHER = """
import glob


class Near:
    name = "near"

    def __init__(self, near=0.06):
        pass

    def agent(self, seed):
        raise SystemExit(70 + len(glob.glob(__file__.rpartition("/agent/")[0] + "/seed*")))
"""


@pytest.mark.slow
def test_an_agent_that_runs_again_cannot_find_its_episodes(forged: Forgery):
    """Its exit code is 70 plus the number of folders of episodes that it finds, unless the guard stops the search."""
    (forged.folder / "agent" / "near.py").write_text(SEARCHER)
    problems = forged.checked(rerun=True, trust=True).problems
    assert "it ended with code 70" in problems[0] or "agents may not" in problems[0]


@pytest.mark.slow
def test_a_bundle_without_the_agents_file_is_refused(forged: Forgery):
    (forged.folder / "agent" / "near.py").unlink()
    assert "the bundle lacks the agent's file near.py" in forged.checked(rerun=True).problems[0]


@pytest.mark.slow
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
def test_a_manifest_starts_nothing_outside_its_bundle(
    kind: str, spec: str, forged: Forgery, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(playing, "IsolatedAgent", lambda *_: pytest.fail("an agent was started"))
    forged.json("bundle.json", lambda manifest: manifest["agent"].update(kind=kind, spec=spec))
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
def test_agents_of_each_kind_start_from_the_bundle(kind: str, spec: str, weights: str, tmp_path: Path):
    for name in ("near.py", "policy.pt", "policy.onnx", "seed0.safetensors"):
        (tmp_path / name).touch()
    agent = {"kind": kind, "spec": spec, "settings": {}, "weights": weights}
    launch = relaunch.launch_of(agent, tmp_path)
    inside = kind == "policy" or ".py:" in spec
    assert (str(launch.spec), launch.command) == (f"{tmp_path}/{spec}" if inside else spec, ())
    assert MANIFEST_KINDS[launch.spec.kind] == kind
    assert launch.weights == (f"{tmp_path}/{weights}" if weights else "")


@pytest.mark.slow
def test_weights_outside_the_bundle_are_refused(forged: Forgery):
    forged.json("bundle.json", lambda manifest: manifest["agent"].update(weights="../bundle.json"))
    assert "the bundle lacks the agent's file ../bundle.json" in forged.checked(rerun=True).problems[0]
