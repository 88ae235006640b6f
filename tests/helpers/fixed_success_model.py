"""Success models with fixed weights, whose predictions do not depend on the state."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dextron_bench.storage import tensors
from dextron_bench.success.network import SIZES, SuccessModel


def arrays(best_action: float, slope: float = 8.0) -> dict[str, np.ndarray]:
    """Arrays of a model with odds of success of exp(-slope |action - best_action|)."""
    layers = [np.zeros(size) for size in SIZES]
    # After the ReLU, the first unit is the distance above the best action, and the second the distance below it.
    layers[0][:2, -1], layers[1][:2] = (1.0, -1.0), (-best_action, best_action)
    layers[2][:2, :2] = np.eye(2)
    layers[4][1, :2] = -slope
    weights = {f"layer.{i}": layer for i, layer in enumerate(layers)}
    return weights | {"mean": np.zeros(48), "deviation": np.ones(48)}


def model(best_action: float, slope: float = 8.0) -> SuccessModel:
    """A model with these arrays."""
    return SuccessModel(arrays(best_action, slope))


def write(file: Path, best_action: float, slope: float = 8.0) -> Path:
    """Writes the file of such a model; returns the file."""
    tensors.write(file, arrays(best_action, slope), {})
    return file
