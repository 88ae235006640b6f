"""Scans play evenly spaced experts, keep what they played, and give windows and the best d_c."""

import numpy as np
import pandas as pd
import pytest

from dextron_bench.experts import outcomes
from dextron_bench.experts.blocks import DamagedBlock
from dextron_bench.reaches import setting
from dextron_bench.reaches.minjerk import MinjerkSource
from dextron_bench.splits import scanning
from dextron_bench.splits.scanning import Scanner
from dextron_bench.storage.folder_config import FolderMismatch
from dextron_bench.world.engine import Engine


def rows(gains: list[float]) -> pd.DataFrame:
    source = MinjerkSource()
    return setting.to_frame([source.sample(np.random.default_rng(0))] * len(gains)).assign(gain=gains)


def test_window_and_best_critical_distance_of_a_scan():
    scores = np.array([[0, 20, 20, 20, 0, 20, 0, 0], [0, 0, 3, 0, 0, 0, 0, 0], np.zeros(8)], float)
    np.testing.assert_allclose(scanning.success_window(scores), [0.89 * 4 / 8, 0.0, 0.0])
    # The middle of band 2 twice; without any reward, the middle of the whole range (band 3).
    np.testing.assert_allclose(scanning.best_critical(scores), 0.01 + 0.89 * np.array([2.5, 2.5, 3.5]) / 8)


@pytest.mark.slow
def test_a_scan_plays_each_row_with_its_own_gain():
    scanner = Scanner(MinjerkSource(), Engine(6, 1))
    scores = scanner.scan(rows([2.0, 1.0]), points=3)
    swapped = scanner.scan(rows([2.0, 1.0]).iloc[::-1], points=3)
    np.testing.assert_array_equal(scores, swapped[::-1])
    assert scores[0, 0] > 1  # Closes at d_c = 0.158, like the paper's expert of this environment.
    assert scores[0, 2] == 0  # Closes at 0.752, long before it reaches the bottle.


def test_no_rows_have_no_scores():
    assert Scanner(MinjerkSource(), Engine(1, 1)).scan(rows([1.0]).head(0), points=3).shape == (0, 3)


@pytest.fixture
def played(tmp_path, monkeypatch) -> list[int]:
    """Two settings are stored together; the list gets the number of draws of every part that is played."""
    sizes: list[int] = []
    original = outcomes.play_blocks

    def count(source, engine, drawn, experts):
        for k, part in drawn:
            sizes.append(len(part))
            yield from original(source, engine, [(k, part)], experts)

    monkeypatch.setattr(outcomes, "play_blocks", count)
    monkeypatch.setattr(scanning, "BLOCK", 2)
    return sizes


@pytest.mark.slow
def test_what_was_played_is_read_again(tmp_path, played):
    first = Scanner(MinjerkSource(), Engine(6, 1), tmp_path).scan(rows([2.0, 1.0, 1.5]), points=2)
    assert played == [4, 2]
    again = Scanner(MinjerkSource(), Engine(6, 1), tmp_path).scan(rows([2.0, 1.0, 1.2]), points=2)
    assert played == [4, 2, 2]  # Only the part with the new gain.
    np.testing.assert_array_equal(first[:2], again[:2])


def test_a_damaged_part_is_named(tmp_path, played):
    scanner = Scanner(MinjerkSource(), Engine(6, 1), tmp_path)
    scanner.scan(rows([2.0]), points=2)
    (file,) = tmp_path.glob("*.parquet")
    file.write_bytes(file.read_bytes()[:-20])
    with pytest.raises(DamagedBlock, match=file.name):
        scanner.scan(rows([2.0]), points=2)


def test_a_folder_of_another_source_is_refused(tmp_path):
    Scanner(MinjerkSource(), Engine(1, 1), tmp_path)
    other = MinjerkSource()
    other.name = "other"
    with pytest.raises(FolderMismatch):
        Scanner(other, Engine(1, 1), tmp_path)
