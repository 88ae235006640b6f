"""Made-up success models, which think the same of every state."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dextron_bench.storage import tensors
from dextron_bench.success.network import SIZES, SuccessModel


def arrays(likes: float, slope: float = 8.0) -> dict[str, np.ndarray]:
    """Of a model whose odds of success are 1 for the action that it likes, and exp(-slope |away|) for others."""
    layers = [np.zeros(size) for size in SIZES]
    layers[0][:2, -1], layers[1][:2] = (1.0, -1.0), (-likes, likes)  # ReLU of how far an action is above, and below.
    layers[2][:2, :2] = np.eye(2)
    layers[4][1, :2] = -slope
    named = {f"layer.{i}": layer for i, layer in enumerate(layers)}
    return named | {"mean": np.zeros(48), "deviation": np.ones(48)}


def model(likes: float, slope: float = 8.0) -> SuccessModel:
    """Such a model."""
    return SuccessModel(arrays(likes, slope))


def write(file: Path, likes: float, slope: float = 8.0) -> Path:
    """Writes such a model's file."""
    tensors.write(file, arrays(likes, slope), {})
    return file
