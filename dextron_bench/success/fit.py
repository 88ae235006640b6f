"""How a success model was trained, as its file says."""

from __future__ import annotations

from importlib.resources import as_file
from typing import Annotated

from msgspec import Meta

from dextron_bench.storage import records
from dextron_bench.storage.records import Count, Number, Record
from dextron_bench.success import network


class FitPoint(Record, frozen=True):
    """Loss and accuracy after an epoch, on learned and on held-out settings."""

    epoch: Count
    loss: Number
    accuracy: Number
    test_loss: Number
    test_accuracy: Number


class Fit(Record, frozen=True):
    """What the file of a model says of its training: its settings, rows of data, and learning curve."""

    fit: dict[str, int | float]
    rows: Count
    epoch: Count
    curve: Annotated[list[FitPoint], Meta(min_length=1)]
    best_epoch: Count


def shipped_fit(reaches: str) -> Fit:
    """How the model that ships for a source of reaches was trained; raises MissingModel."""
    with as_file(network.model_file(reaches)) as file:
        return records.read_about(file, Fit)
