"""Training of the success model: cross entropy on batches drawn from the disk, resumable (paper, II.E and table II)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from dextron_bench.experts import blocks
from dextron_bench.storage import tensors
from dextron_bench.storage.folder_config import FolderMismatch
from dextron_bench.success.dataset import Dataset
from dextron_bench.success.network import CLIP, SIZES, SuccessModel

STATE = "fit.safetensors"  # In the folder of a data set: the training as it stands.
MODEL = "model.safetensors"
SCALED_BY = 100_000  # Transitions from which the scale of states is taken.
TESTED = 50_000  # Transitions of held-out episodes that make a point of the learning curve.
MEMORY = ("step", "exp_avg", "exp_avg_sq")

Report = Callable[[int, int, str], None]  # Told (epochs done, epochs in all, how it goes).


class BadTrainingConfig(ValueError):
    """A training that cannot be."""


@dataclass(frozen=True)
class TrainingConfig:
    """How the model is trained; batch and learning rate are the paper's, which does not say how long an epoch is."""

    epochs: int = 30
    updates: int = 1000
    """Batches in an epoch."""
    batch: int = 1024
    learning_rate: float = 1e-3
    halved_every: int = 100
    """Epochs."""
    seed: int = 0

    def __post_init__(self) -> None:
        if min(self.epochs, self.updates, self.batch, self.halved_every) < 1 or self.learning_rate <= 0.0:
            raise BadTrainingConfig("epochs, updates, batch, halving and learning rate of a training are positive")
        if self.seed < 0:
            raise BadTrainingConfig(f"the seed of a training is 0 or more, not {self.seed}")


def train(folder: Path, settings: TrainingConfig, report: Report = lambda done, wanted, note: None) -> SuccessModel:
    """Trains on the data set in a folder, or goes on where a training there was stopped; returns the model.

    It is that of the epoch with the lowest loss on the episodes held out, since later ones learn theirs by heart and
    grow too sure. The folder then holds it, with its learning curve: losses and accuracies on both halves after each
    epoch. The same call ends with the same bytes, however often it was stopped, and if it had fewer epochs before.
    Raises FolderMismatch, EmptyDataset, BadDataset, BadTensors.
    """
    lesson = _TrainingRun(folder, settings)
    file = folder / STATE
    if file.exists():
        lesson.resume(file)
    while lesson.epoch < settings.epochs:
        report(lesson.epoch, settings.epochs, lesson.note())
        lesson.advance()
        tensors.write(file, lesson.state(), lesson.about())
    report(lesson.epoch, settings.epochs, lesson.note())
    tensors.write(folder / MODEL, lesson.best, lesson.about())
    return SuccessModel(lesson.best)


def initial_network(rng: np.random.Generator) -> nn.Sequential:
    """New layers, drawn uniformly as PyTorch draws them."""
    (_, wide), (hidden,), _, _, (classes, _), _ = SIZES
    made = nn.Sequential(
        nn.Linear(wide, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(), nn.Linear(hidden, classes)
    )
    with torch.no_grad():
        for layer in made:
            if isinstance(layer, nn.Linear):
                bound = layer.in_features**-0.5
                for parameter in (layer.weight, layer.bias):
                    parameter.copy_(torch.tensor(rng.uniform(-bound, bound, tuple(parameter.shape))))
    return made


class _TrainingRun:
    """A training under way."""

    def __init__(self, folder: Path, settings: TrainingConfig) -> None:
        self._folder, self._settings = folder, settings
        self._data, self._held = Dataset(folder), Dataset(folder, test=True)
        self.epoch, self.curve, self.best = 0, list[dict[str, float]](), dict[str, np.ndarray]()
        states, _, _ = self._data.take(self._rng(1).integers(len(self._data), size=SCALED_BY))
        self._mean = states.mean(axis=0, dtype=np.float64)
        self._deviation = np.sqrt(states.var(axis=0, dtype=np.float64) + 1e-8)
        self._network = initial_network(self._rng(0))
        self._parameters = list(self._network.parameters())
        self._optimiser = torch.optim.Adam(self._parameters, lr=settings.learning_rate, fused=True)
        self._loss = nn.CrossEntropyLoss()

    def advance(self) -> None:
        """One epoch."""
        settings, rng = self._settings, self._rng(2, self.epoch)
        for group in self._optimiser.param_groups:
            group["lr"] = settings.learning_rate * 0.5 ** (self.epoch // settings.halved_every)
        sums = np.zeros(2)
        for _ in range(settings.updates):
            states, actions, outcomes = self._data.take(rng.integers(len(self._data), size=settings.batch))
            wanted = torch.tensor(outcomes)
            found = self._network(self._inputs(states, actions))
            loss = self._loss(found, wanted)
            self._optimiser.zero_grad(set_to_none=True)
            loss.backward()
            self._optimiser.step()
            sums += loss.item(), (found.argmax(dim=1) == wanted).double().mean().item()
        self.epoch += 1
        loss, accuracy = sums / settings.updates
        self.curve.append({"epoch": self.epoch, "loss": loss, "accuracy": accuracy} | self._test())
        if self.best_epoch == self.epoch:
            self.best = self.arrays()

    def _test(self) -> dict[str, float]:
        states, actions, outcomes = self._held.take(self._rng(3).integers(len(self._held), size=TESTED))
        with torch.inference_mode():
            found = self._network(self._inputs(states, actions))
            wanted = torch.tensor(outcomes)
            right = (found.argmax(dim=1) == wanted).double().mean().item()
            return {"test_loss": self._loss(found, wanted).item(), "test_accuracy": right}

    def _inputs(self, states: np.ndarray, actions: np.ndarray) -> Tensor:
        """What the network takes, (B, 49), for states (B, 48) and actions (B,)."""
        scaled = np.clip((states - self._mean) / self._deviation, -CLIP, CLIP)
        return torch.tensor(np.concatenate([scaled, actions[:, None]], axis=1), dtype=torch.float32)

    @property
    def best_epoch(self) -> int:
        """The epoch with the lowest loss on the episodes held out, so far."""
        return int(min(self.curve, key=lambda point: point["test_loss"])["epoch"])

    def note(self) -> str:
        """How it goes."""
        return f"held-out accuracy {100 * self.curve[-1]['test_accuracy']:.1f} %" if self.curve else ""

    def about(self) -> dict[str, Any]:
        """What goes with the arrays."""
        told = {"fit": asdict(self._settings), "rows": len(self._data), "epoch": self.epoch, "curve": self.curve}
        return told | {"best_epoch": self.best_epoch, "data": blocks.claimed(self._folder)}

    def arrays(self) -> dict[str, np.ndarray]:
        """Copies of what the model is made of."""
        found = {f"layer.{i}": parameter.detach().numpy().copy() for i, parameter in enumerate(self._parameters)}
        return found | {"mean": self._mean, "deviation": self._deviation}

    def state(self) -> dict[str, np.ndarray]:
        """The model as it is, and at its best, and the optimiser's memory."""
        found = self.arrays() | {f"best.{name}": array for name, array in self.best.items()}
        for i, parameter in enumerate(self._parameters):
            memory = self._optimiser.state[parameter]
            found |= {f"adam.{i}.{name}": memory[name].numpy().copy() for name in MEMORY}
        return found

    def resume(self, file: Path) -> None:
        """Takes the place of the training that wrote a file; raises FolderMismatch, BadTensors."""
        about, arrays = tensors.read_about(file), tensors.read(file)
        wanted = {"fit": asdict(self._settings), "rows": len(self._data)}
        shorter = {**about.get("fit", {}), "epochs": self._settings.epochs}  # That of fewer epochs goes on.
        if {"fit": shorter, "rows": about.get("rows")} != wanted or about["epoch"] > self._settings.epochs:
            raise FolderMismatch(
                f"{self._folder} holds another training; remove {file.name} there, or take its settings"
            )
        self.epoch, self.curve = about["epoch"], about["curve"]
        if lacking := [name for name in self.arrays() if f"best.{name}" not in arrays]:
            raise tensors.BadTensors(file, f"it is no training under way: it lacks 'best.{lacking[0]}'; remove it")
        self.best = {name: arrays[f"best.{name}"] for name in self.arrays()}
        with torch.no_grad():
            for i, parameter in enumerate(self._parameters):
                parameter.copy_(torch.tensor(arrays[f"layer.{i}"]))
                self._optimiser.state[parameter] = {n: torch.tensor(arrays[f"adam.{i}.{n}"]) for n in MEMORY}

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self._settings.seed, *stream])
