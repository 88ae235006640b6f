"""A split under the tracks that change the bottle: each row has a bottle, and an expert that succeeds with it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.experts import policies
from dextron_bench.splits import tracks
from dextron_bench.splits.loading import Catalogue, SplitEntry, bottles_file, entries
from dextron_bench.splits.near_equal import SETTING
from dextron_bench.splits.scanning import Scanner, best_critical, success_window
from dextron_bench.storage import atomic, records
from dextron_bench.world import bottle, task
from dextron_bench.world.bottles import model_bottle

SPLIT = "test"  # The split that is played with other bottles.
POINTS = 32  # Of a scan of d_c.
TRIES = 6  # Bottles that are drawn for a row; a row that none of them solves keeps the model's.
COLUMNS = ["split", *SETTING, "gain", "critical", "window", *bottle.COLUMNS]


def build(scanner: Scanner, splits: pd.DataFrame, folder: Path) -> dict[str, SplitEntry]:
    """Draws, certifies and writes the rows of every track into `folder`; returns their entries in the catalogue.

    `splits` is the table of the source's splits.
    """
    plain = splits[splits["split"] == SPLIT].reset_index(drop=True)
    parts = [certified(scanner, plain, track) for track in tracks.BOTTLES.values()]
    table = pd.concat(parts, ignore_index=True)
    reaches = scanner.source.name
    atomic.write_atomically(folder / bottles_file(reaches), lambda part: table.to_parquet(part))
    added, catalogue = entries(table), folder / "splits.json"
    known = records.read(catalogue, Catalogue)
    atomic.write_json(catalogue, known | {reaches: known[reaches] | added})
    return added


def certified(scanner: Scanner, plain: pd.DataFrame, track: tracks.Track) -> pd.DataFrame:
    """The rows of a split with bottles that the search solves: with the row's own gain, or with one that is drawn.

    A bottle that no expert of the scan succeeds with is drawn again, up to TRIES times. After that the row keeps the
    model's bottle and its own expert.
    """
    left, parts = plain, []
    for attempt in range(TRIES):
        drawn = draw(left, track, attempt)
        scores = scanner.scan(drawn, POINTS)
        solved = (scores == task.SUCCESS).any(axis=1)
        parts.append(drawn.assign(critical=best_critical(scores), window=success_window(scores))[solved])
        left = left[~solved]
    parts.append(left.assign(**asdict(model_bottle())))
    return pd.concat(parts).sort_index().assign(split=tracks.name_of(SPLIT, track.name))[COLUMNS]


def draw(rows: pd.DataFrame, track: tracks.Track, attempt: int) -> pd.DataFrame:
    """Rows with new bottles; from the second attempt on with new gains, too. The quantity is log-uniform."""
    assert track.bottle is not None
    rng = np.random.default_rng([list(tracks.BOTTLES).index(track.name), attempt, 6])
    low, high = np.log([track.bottle.low, track.bottle.high])
    drawn = rows.assign(**asdict(model_bottle()))
    drawn[track.bottle.quantity] = np.exp(rng.uniform(low, high, len(rows)))
    return drawn.assign(gain=rng.uniform(*policies.GAIN, len(rows))) if attempt else drawn
