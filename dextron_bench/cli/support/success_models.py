"""The success model that a command uses, and the folder of its data set."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dextron_bench.cli.support.output import print_warning

if TYPE_CHECKING:
    from dextron_bench.success.network import SuccessModel


def folder_of(runs: Path, reaches: str, seed: int) -> Path:
    """The folder of a data set and of the model that is trained on it."""
    return runs / "success" / reaches / f"seed{seed}"


def load_model(file: Path | None, runs: Path, reaches: str) -> SuccessModel:
    """The model in a file; without one, the model trained in a folder of runs, or else the shipped one."""
    from dextron_bench.storage import tensors
    from dextron_bench.success import network, training

    trained = folder_of(runs, reaches, 0) / training.MODEL
    if file is None and not trained.exists():
        return network.shipped_model(reaches)
    path = file or trained
    source = tensors.read_about(path).get("data", {}).get("search", {}).get("reaches", reaches)
    if source != reaches:
        print_warning(f"{path} was trained on {source} reaches, not on {reaches} ones")
    return network.SuccessModel(tensors.read(path))
