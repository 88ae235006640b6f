"""TorchScript and ONNX files: they play as agents, other files are refused, and none can write files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import onnx.helper
import onnx.numpy_helper
import pytest
import torch

from dextron_bench.errors import BadInput
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.isolation import policy_files, sandbox
from dextron_bench.methods.isolation.isolated_agent import IsolatedAgent
from dextron_bench.methods.isolation.launch import NoSandbox, prepare_launch
from tests.helpers.isolated_play import CASES, play


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
    with pytest.raises(BadInput, match=r"file ends in \.pt or \.onnx"):
        policy_files.load(tmp_path / "policy.pkl")


@pytest.mark.slow
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
