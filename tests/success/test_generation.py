"""The success model's data set: which episodes it holds, and that a stopped generation ends with the same bytes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from baselines.floors import Nothing
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.splits.rows import Rows
from dextron_bench.storage import folder_config, tensors
from dextron_bench.success import generation
from dextron_bench.success.dataset import BadDataset
from dextron_bench.success.generation import (
    POLICY,
    SOLVED,
    UNIFORM,
    BadDatasetConfig,
    DatasetConfig,
    Generation,
    Tally,
    draw_rows,
)
from tests.helpers.short_reaches import SETTINGS, SOURCE

TRAIN = Rows(cases=tuple(Case(setting, Expert(1.2, 0.3), 0.1) for setting in SETTINGS))
SMALL = DatasetConfig("synthetic", block=5, policies=("nothing",))


def generate_small(folder: Path, rows: int, config: DatasetConfig = SMALL, threads: int = 1) -> dict[str, Tally]:
    return work_in(folder, rows, config, threads).run()


def work_in(folder: Path, rows: int = 1, config: DatasetConfig = SMALL, threads: int = 1) -> Generation:
    return Generation(config, folder, rows, SOURCE, TRAIN, {"nothing": Nothing().agent(0)}, threads=threads)


def file_contents(folder: Path) -> dict[str, bytes]:
    """The bytes of all files below a folder, by path."""
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_half_of_the_blocks_have_experts_and_half_have_policies():
    assert [SMALL.kind(number) for number in range(5)] == [SOLVED, POLICY, UNIFORM, POLICY, SOLVED]
    assert [DatasetConfig().kind(number) for number in range(3)] == [SOLVED, UNIFORM, SOLVED]
    two_policies = DatasetConfig(policies=("a", "b"))
    assert [two_policies.policy(number) for number in (1, 3, 5, 7)] == ["a", "b", "a", "b"]


def test_uniform_blocks_have_only_reaches_of_train_but_new_settings_and_experts():
    rows = draw_rows(SOURCE, TRAIN.first(1), DatasetConfig(block=40), number=1)
    assert {case.setting.reach for case in rows.cases} == {TRAIN.case(0).setting.reach}
    assert len({case.setting.offset_x for case in rows.cases}) == 40
    gains, criticals = zip(*((case.expert.gain, case.expert.critical) for case in rows.cases), strict=True)
    assert min(gains) >= 1.0
    assert max(gains) <= 1.5
    assert min(criticals) >= 0.01
    assert max(criticals) <= 0.9
    assert max(criticals) - min(criticals) > 0.5


def test_a_stopped_generation_continues_to_the_same_bytes_with_any_number_of_threads(tmp_path: Path):
    tallies = generate_small(tmp_path / "a", 600)
    generate_small(tmp_path / "b", 100, threads=2)
    assert generate_small(tmp_path / "b", 600, threads=2) == tallies
    assert file_contents(tmp_path / "a") == file_contents(tmp_path / "b")
    assert sum(tally.rows for tally in tallies.values()) >= 600
    blocks = len(file_contents(tmp_path / "a")) - 1  # One file is the config.
    assert tallies[POLICY].episodes == 5 * sum(SMALL.kind(number) == POLICY for number in range(blocks))


def test_a_block_holds_the_played_episodes_in_float32(tmp_path: Path):
    generate_small(tmp_path, 1)
    block = tensors.read(work_in(tmp_path).block_file(0))
    assert block["states"].shape == (block["starts"][-1], 48)
    assert block["states"].dtype == block["actions"].dtype == np.float32
    np.testing.assert_array_equal(block["actions"][block["starts"][:-1]], 0.0)  # An expert's first action.
    header = work_in(tmp_path).block_file(0).stat().st_size - sum(array.nbytes for array in block.values())
    assert sum(array.nbytes for array in (block["states"], block["actions"])) == 4 * 49 * len(block["actions"])
    assert 0 < header < 1000  # Nothing else is in the file.


def test_only_an_episode_with_the_whole_return_is_labelled_a_success(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Most failures score more than 0: the bottle was up, and fell before the countdown was over."""

    def rollout(agent: object, source: object, rows: Rows, threads: int) -> Iterator[tuple[int, Episode]]:
        for row, score in enumerate((20.0, 19.0, 1.0, 0.0, 20.0)):
            rewards = np.array([score, 0.0])
            yield row, Episode(rows.case(row).setting, np.zeros((3, 48)), np.zeros((2, 1)), rewards, False, True)

    monkeypatch.setattr(generation, "rollout", rollout)
    tallies = generate_small(tmp_path, 1)
    assert tensors.read(work_in(tmp_path).block_file(0))["solved"].tolist() == [1, 0, 0, 0, 1]
    assert tallies[SOLVED] == Tally(rows=10, episodes=5, solved=2)


def test_a_folder_of_another_data_set_is_refused(tmp_path: Path):
    generate_small(tmp_path, 1)
    with pytest.raises(folder_config.FolderMismatch, match=r"holds another data set.*choose another folder"):
        generate_small(tmp_path, 1, DatasetConfig("synthetic", seed=1, block=5))
    with pytest.raises(BadDatasetConfig, match="at least 5 episodes"):
        DatasetConfig(block=0)


def test_a_truncated_block_and_a_number_of_rows_below_1_are_refused(tmp_path: Path):
    generate_small(tmp_path, 100)
    file = work_in(tmp_path).block_file(0)
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(BadDataset, match=r"000000.*remove it"):
        generate_small(tmp_path, 100_000)
    with pytest.raises(BadDatasetConfig, match="--rows"):
        generate_small(tmp_path / "other", 0)
    assert not (tmp_path / "other").exists()
