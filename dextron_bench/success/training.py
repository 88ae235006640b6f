"""Trains the success model with cross entropy on batches from the disk (paper, II.E and table II).

A killed training continues after its last epoch and ends with the same bytes.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from msgspec import to_builtins
from torch import Tensor, nn

from dextron_bench.errors import BadInput
from dextron_bench.storage import records, tensors
from dextron_bench.storage.atomic import Json
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.success.dataset import Dataset, read_config
from dextron_bench.success.fit import Fit, FitPoint
from dextron_bench.success.network import CLIP, SIZES, SuccessModel

STATE = "fit.safetensors"  # In the folder of a data set: all that an unfinished training needs to continue.
MODEL = "model.safetensors"  # In the same folder: the trained model.
SCALE_ROWS = 100_000  # Transitions that give mean and deviation of the states.
TEST_ROWS = 50_000  # Transitions of held-out settings for each point of the learning curve.
ADAM_STATE = ("step", "exp_avg", "exp_avg_sq")


@dataclass(frozen=True)
class TrainingConfig:
    """How to train the model. Batch and learning rate are the paper's; the paper does not define an epoch's length."""

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
            raise BadInput("epochs, updates, batch, halved_every and learning_rate of a training are above 0")
        if self.seed < 0:
            raise BadInput(f"the seed of a training must be 0 or more, not {self.seed}")


def train(folder: Path, config: TrainingConfig, progress: Progress = no_progress) -> SuccessModel:
    """Trains on the data set in a folder, or continues a training that was stopped there; returns the model.

    The model is from the epoch with the lowest loss on the held-out settings, because later epochs overfit and become
    overconfident. The folder then holds the model and its learning curve: loss and accuracy on learned and held-out
    settings after each epoch. A call that was stopped, or that had fewer epochs, ends with the same bytes when it is
    repeated. `progress` receives epochs. Raises BadInput, NotFound, BadInput, BadTensors.
    """
    run = _TrainingRun(folder, config)
    file = folder / STATE
    if file.exists():
        run.resume(file)
    while run.epoch < config.epochs:
        progress(run.epoch, config.epochs, run.note())
        run.advance()
        tensors.write(file, run.state(), run.about())
    progress(run.epoch, config.epochs, run.note())
    tensors.write(folder / MODEL, run.best, run.about())
    return SuccessModel(run.best)


def initial_network(rng: np.random.Generator) -> nn.Sequential:
    """A network with random weights in the same uniform ranges as PyTorch's own initialisation."""
    (_, inputs), (hidden,), _, _, (classes, _), _ = SIZES
    network = nn.Sequential(
        nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(), nn.Linear(hidden, classes)
    )
    with torch.no_grad():
        for layer in network:
            if isinstance(layer, nn.Linear):
                bound = layer.in_features**-0.5
                for parameter in (layer.weight, layer.bias):
                    parameter.copy_(torch.tensor(rng.uniform(-bound, bound, tuple(parameter.shape))))
    return network


class _TrainingRun:
    """State of a training between two epochs."""

    def __init__(self, folder: Path, config: TrainingConfig) -> None:
        self._folder, self._config = folder, config
        self._data, self._test_data = Dataset(folder), Dataset(folder, test=True)
        self.epoch, self.curve, self.best = 0, list[FitPoint](), dict[str, np.ndarray]()
        states, _, _ = self._data.take(self._rng(1).integers(len(self._data), size=SCALE_ROWS))
        self._mean = states.mean(axis=0, dtype=np.float64)
        self._deviation = np.sqrt(states.var(axis=0, dtype=np.float64) + 1e-8)
        self._network = initial_network(self._rng(0))
        self._parameters = list(self._network.parameters())
        self._optimiser = torch.optim.Adam(self._parameters, lr=config.learning_rate, fused=True)
        self._loss = nn.CrossEntropyLoss()

    def advance(self) -> None:
        """Trains for one epoch and adds its point to the learning curve."""
        config, rng = self._config, self._rng(2, self.epoch)
        for group in self._optimiser.param_groups:
            group["lr"] = config.learning_rate * 0.5 ** (self.epoch // config.halved_every)
        sums = np.zeros(2)
        for _ in range(config.updates):
            states, actions, outcomes = self._data.take(rng.integers(len(self._data), size=config.batch))
            labels = torch.tensor(outcomes)
            logits = self._network(self._inputs(states, actions))
            loss = self._loss(logits, labels)
            self._optimiser.zero_grad(set_to_none=True)
            loss.backward()
            self._optimiser.step()
            sums += loss.item(), (logits.argmax(dim=1) == labels).double().mean().item()
        self.epoch += 1
        loss, accuracy = sums / config.updates
        self.curve.append(FitPoint(self.epoch, float(loss), float(accuracy), *self._test()))
        if self.best_epoch == self.epoch:
            self.best = self.arrays()

    def _test(self) -> tuple[float, float]:
        """Loss and accuracy on held-out settings."""
        states, actions, outcomes = self._test_data.take(self._rng(3).integers(len(self._test_data), size=TEST_ROWS))
        with torch.inference_mode():
            logits, labels = self._network(self._inputs(states, actions)), torch.tensor(outcomes)
            accuracy = (logits.argmax(dim=1) == labels).double().mean().item()
            return self._loss(logits, labels).item(), accuracy

    def _inputs(self, states: np.ndarray, actions: np.ndarray) -> Tensor:
        """Inputs (B, 49) of the network for states (B, 48) and actions (B,)."""
        scaled = np.clip((states - self._mean) / self._deviation, -CLIP, CLIP)
        return torch.tensor(np.concatenate([scaled, actions[:, None]], axis=1), dtype=torch.float32)

    @property
    def best_epoch(self) -> int:
        """The epoch with the lowest loss on held-out settings so far."""
        return min(self.curve, key=lambda point: point.test_loss).epoch

    def note(self) -> str:
        """A note on the progress: the last accuracy on held-out settings."""
        return f"held-out accuracy {100 * self.curve[-1].test_accuracy:.1f} %" if self.curve else ""

    def about(self) -> dict[str, Json]:
        """How the model was trained, for the header of its file."""
        fit = Fit(asdict(self._config), len(self._data), self.epoch, self.curve, self.best_epoch)
        return to_builtins(fit) | {"data": to_builtins(read_config(self._folder)) or {}}

    def arrays(self) -> dict[str, np.ndarray]:
        """Copies of the arrays of a SuccessModel."""
        layers = {f"layer.{i}": parameter.detach().numpy().copy() for i, parameter in enumerate(self._parameters)}
        return layers | {"mean": self._mean, "deviation": self._deviation}

    def state(self) -> dict[str, np.ndarray]:
        """Arrays of the current model and of the best one, and the state of the optimiser."""
        arrays = self.arrays() | {f"best.{name}": array for name, array in self.best.items()}
        for i, parameter in enumerate(self._parameters):
            memory = self._optimiser.state[parameter]
            arrays |= {f"adam.{i}.{name}": memory[name].numpy().copy() for name in ADAM_STATE}
        return arrays

    def resume(self, file: Path) -> None:
        """Restores the training that wrote a file; raises BadInput, BadTensors."""
        about, arrays = records.read_about(file, Fit), tensors.read(file)
        expected = {"fit": asdict(self._config), "rows": len(self._data)}
        stored = {**about.fit, "epochs": self._config.epochs}  # A training with fewer epochs may continue.
        if {"fit": stored, "rows": about.rows} != expected or about.epoch > self._config.epochs:
            raise BadInput(
                f"{self._folder} holds another training; remove {file.name} there, or train with its settings"
            )
        if len(about.curve) != about.epoch:
            raise tensors.OtherTensors(file, "its curve does not have a point for each epoch")
        self.epoch, self.curve = about.epoch, list(about.curve)
        expected_names = {*self.arrays(), *(f"best.{name}" for name in self.arrays()), *self._adam_names()}
        if lacking := sorted(expected_names - arrays.keys()):
            raise tensors.OtherTensors(file, f"it is not an unfinished training: it lacks {lacking[0]!r}")
        self.best = {name: arrays[f"best.{name}"] for name in self.arrays()}
        with torch.no_grad():
            for i, parameter in enumerate(self._parameters):
                parameter.copy_(torch.tensor(arrays[f"layer.{i}"]))
                self._optimiser.state[parameter] = {n: torch.tensor(arrays[f"adam.{i}.{n}"]) for n in ADAM_STATE}

    def _adam_names(self) -> list[str]:
        """Names of the optimiser's arrays in a file."""
        return [f"adam.{i}.{name}" for i in range(len(self._parameters)) for name in ADAM_STATE]

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self._config.seed, *stream])
