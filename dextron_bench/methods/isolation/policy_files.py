"""Policies in files that run no code of their own: TorchScript and ONNX."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from dextron_bench.errors import BadInput
from dextron_bench.methods.specs import POLICIES


class FilePolicy:
    """Maps states to actions by a function without memory, float32 in and out."""

    def __init__(self, function: Callable[[np.ndarray], np.ndarray]) -> None:
        self._function = function

    def reset(self, episodes: np.ndarray) -> None:
        """Does nothing: the policy has no memory."""

    def act(self, states: np.ndarray) -> np.ndarray:
        """Actions (N, 1) for states (N, 48)."""
        return np.asarray(self._function(states.astype(np.float32)), np.float64)


def load(file: Path) -> FilePolicy:
    """The policy (N, 48) to (N, 1) of a TorchScript (.pt) or ONNX (.onnx) file; raises BadInput."""
    loaders = {".pt": _load_torchscript, ".onnx": _load_onnx}
    if file.suffix not in loaders:
        raise BadInput(f"{file} is not a policy: a policy's file ends in {' or '.join(POLICIES)}")
    return FilePolicy(loaders[file.suffix](file))


def _load_torchscript(file: Path) -> Callable[[np.ndarray], np.ndarray]:
    import torch

    torch.set_num_threads(1)
    try:
        module = torch.jit.load(str(file), map_location="cpu").eval()
    except (RuntimeError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise BadInput(f"{file} is not a TorchScript file ({reason}); torch.jit.save writes one") from error

    def act(states: np.ndarray) -> np.ndarray:
        with torch.inference_mode():
            return module(torch.from_numpy(states)).numpy()

    return act


def _load_onnx(file: Path) -> Callable[[np.ndarray], np.ndarray]:
    try:
        import onnxruntime  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError as error:
        raise BadInput(f"{file} needs ONNX Runtime: `pip install onnxruntime`") from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    try:
        session = onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime has exception types of its own.
        raise BadInput(f"{file} is not an ONNX file that can be run ({str(error).splitlines()[0]})") from error
    name = session.get_inputs()[0].name
    return lambda states: np.asarray(session.run(None, {name: states})[0])
