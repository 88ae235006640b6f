"""The two-sample test: an AUC of 0.5 for equal samples, more for others, and models without the held-out reaches.

Long, because the reaches and classifiers of the study are shared by all its tests.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.cli.data.likeness import print_likeness
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.recorded import cache as recorded_cache
from dextron_bench.reaches.setting import Source
from dextron_bench.reaches.synthetic import two_sample, two_sample_held_out
from dextron_bench.reaches.synthetic.generator import generate
from dextron_bench.reaches.synthetic.parameters import load, shipped_parameters
from dextron_bench.reaches.synthetic.two_sample_features import (
    GROUPS,
    features,
    measures,
    nearest_recorded,
    single_feature_aucs,
    summaries,
)
from tools import fit_synthetic
from tools.fit_synthetic import compared

STUDY = """
import sys
from dataclasses import replace
from dextron_bench.reaches.synthetic import two_sample, two_sample_held_out
from dextron_bench.reaches.recorded import cache
from dextron_bench.reaches.synthetic.generator import generate
from dextron_bench.reaches.synthetic.parameters import shipped_parameters
two_sample.TREES, two_sample.REPEATS, two_sample.COUNT = 5, 20, 16
reaches = [generate(number, shipped_parameters()) for number in (*range(16), *range(64, 80), *range(192, 208))]
cache.load_reaches = lambda: [replace(r, name=f"{r.subject}_{k // 16}_{k % 16}") for k, r in enumerate(reaches)]
two_sample_held_out.fit = lambda reaches, seed: shipped_parameters()
from dextron_bench.cli.main import main
sys.exit(main())
"""  # The command line with made-up recordings of three subjects, and small classifiers.


@pytest.fixture(scope="module")
def reaches() -> list[Reach]:
    """48 reaches of many sessions, then another 48 with the same regions and sessions."""
    cells = [i % 16 + 16 * (5 * i % 36) for i in range(48)]
    return [generate(cell + 16 * 36 * copy, shipped_parameters()) for copy in range(2) for cell in cells]


@pytest.fixture
def few_trees(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(two_sample, "TREES", 30)
    monkeypatch.setattr(two_sample, "REPEATS", 50)


@pytest.fixture(scope="module")
def straight() -> Reach:
    """A straight reach of 0.4 m along x in 1 s at constant speed, then a lift of 0.1 m in 0.5 s, without rotation."""
    times = np.linspace(0.0, 1.5, 151)
    positions = np.stack([np.minimum(times, 1.0) * 0.4 - 0.5, 0 * times, 0.1 + 0.2 * np.maximum(times - 1, 0)], axis=1)
    return Reach("straight", times, positions, np.tile([1.0, 0.0, 0.0, 0.0], (151, 1)), 1.0, "a", 0, 0)


def test_measures_of_a_straight_reach(straight: Reach):
    values = measures(straight)
    assert values["duration [s]"] == 1.5
    assert values["path length [m]"] == pytest.approx(0.5, rel=0.01)
    assert values["peak speed [m/s]"] == pytest.approx(0.4, rel=0.05)
    assert values["curvature"] == pytest.approx(1.0, rel=0.03)
    assert values["mean turning speed [rad/s]"] == pytest.approx(0.0, abs=1e-9)
    assert (values["grasp height [m]"], values["end height [m]"]) == (pytest.approx(0.1, abs=1e-3), pytest.approx(0.2))


def test_features_have_one_finite_row_for_each_reach(reaches: list[Reach]):
    groups = features(reaches[:5])
    assert tuple(groups) == GROUPS
    for values in groups.values():
        assert len(values) == 5
        assert np.isfinite(values).all()


@pytest.mark.slow
def test_equal_samples_have_an_auc_near_one_half(reaches: list[Reach], few_trees: None):
    table = two_sample.auc_table(reaches[:48], reaches[48:], 0)
    whole = table[table.stratum == "all"]
    assert sorted(whole.group.unique()) == sorted([*GROUPS, "everything"])
    assert whole.auc.mean() == pytest.approx(0.5, abs=0.1)
    assert (whole.low <= whole.auc).all()
    assert (whole.auc <= whole.high).all()


@pytest.mark.slow
def test_a_difference_in_duration_shows_in_the_durations_alone(reaches: list[Reach], few_trees: None):
    slower = [replace(r, times=r.times * 1.5, reached=r.reached * 1.5) for r in reaches[48:]]
    table = two_sample.auc_table(reaches[:48], slower, 0).set_index(["group", "classifier", "stratum"]).auc
    assert table["durations", "forest", "all"] > 0.9
    assert table["durations", "logistic", "ring 2"] > 0.8
    assert table["orientations", "forest", "all"] < 0.65


def test_strata_cover_rings_angles_and_regions(reaches: list[Reach]):
    members = dict(two_sample.strata(reaches))
    assert len(members) == 1 + 4 + 4 + 16
    assert [members[name].sum() for name in ("all", "ring 3", "angle 0", "2-1")] == [96, 24, 24, 6]


def test_the_auc_agrees_with_a_calculation_by_hand():
    interval = two_sample.auc_interval(np.array([0.1, 0.4]), np.array([0.3, 0.4]), np.random.default_rng(0))
    assert interval["auc"] == (1 + 1 + 0 + 0.5) / 4
    assert 0.0 <= interval["low"] <= interval["auc"] <= interval["high"] <= 1.0
    assert np.isnan(two_sample.auc_interval(np.zeros(0), np.ones(3), np.random.default_rng(0))["auc"])


def test_every_label_is_spread_evenly_over_the_folds():
    labels = np.repeat([0, 1, 2], 10)
    fold = two_sample_held_out.folds(labels, 5, np.random.default_rng(0))
    assert all((np.bincount(fold[labels == label]) == 2).all() for label in range(3))


def test_the_reaches_of_a_subject_from_a_region_share_a_fold(reaches: list[Reach]):
    fold = two_sample_held_out.cell_folds(reaches[:48], reaches[48:], np.random.default_rng(0))
    np.testing.assert_array_equal(fold[:48], fold[48:])  # The second half repeats the cells of the first.
    assert set(np.bincount(fold) > 10) == {True}


def test_held_out_reaches_come_from_models_without_them(reaches: list[Reach], monkeypatch: pytest.MonkeyPatch):
    recorded = [replace(r, name=f"x_{i // 16}_{i % 16}") for i, r in enumerate(reaches[:80])]
    fitted: list[set[str]] = []

    def record_names(subset: list[Reach], seed: int):
        fitted.append({r.name for r in subset})
        return shipped_parameters()

    monkeypatch.setattr(two_sample_held_out, "fit", record_names)
    counterparts = two_sample_held_out.held_out(recorded, 0)
    all_names = {r.name for r in recorded}
    assert len(counterparts) == 2 * len(recorded)
    assert sorted(name for names in fitted for name in all_names - names) == sorted(all_names)


def test_each_subject_is_held_out_once(reaches: list[Reach], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(two_sample_held_out, "fit", lambda subset, seed: shipped_parameters())
    recorded = [replace(r, subject=f"p{i % 4}") for i, r in enumerate(reaches[:16])]
    subjects: list[str] = []
    for held, synthetic, others in two_sample_held_out.held_out_subjects(recorded, 0):
        assert not {r.subject for r in held} & {r.subject for r in others}
        assert len(synthetic) == len(others)
        subjects += {r.subject for r in held}
    assert sorted(subjects) == ["p0", "p1", "p2", "p3"]


def test_summaries_have_both_sources_for_each_measure(reaches: list[Reach]):
    table = summaries(reaches[:20], reaches[20:40])
    assert list(table.source[:2]) == ["real", "synthetic"]
    assert len(table) == 2 * 10
    quantiles = table.drop(columns=["measure", "source"]).to_numpy()
    assert (np.diff(quantiles, axis=1) >= 0).all()


def test_without_scikit_learn_the_error_says_how_to_install_it(
    reaches: list[Reach], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setitem(sys.modules, "sklearn.ensemble", None)
    with pytest.raises(two_sample.MissingClassifiers, match="pip install scikit-learn"):
        two_sample.auc_table(reaches[:4], reaches[4:8], 0)
    monkeypatch.setattr(recorded_cache, "load_reaches", lambda: reaches[:4])
    monkeypatch.setattr(two_sample_held_out, "fit", None)
    assert main.main(["data", "likeness"]) == 2
    printed = capsys.readouterr()
    assert (printed.out, printed.err.count("\n")) == ("", 1)
    assert "pip install scikit-learn" in printed.err


def likeness(*words: str) -> int:
    """The exit code of `data likeness`."""
    return main.main(["data", "likeness", *words])


def fit_command(*words: str) -> int:
    """The exit code of `python -m tools.fit_synthetic`."""
    return fit_synthetic.main(words)


@pytest.mark.parametrize("command", [fit_command, likeness])
def test_without_recordings_the_error_says_how_to_get_them(
    command: Callable[..., int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.delenv("DEXTRON_DATA", raising=False)
    monkeypatch.setenv("DEXTRON_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    assert command() == 2
    printed = capsys.readouterr()
    assert (printed.out, printed.err.count("\n")) == ("", 1)
    assert "data import --from" in printed.err
    assert command("--seed", "-1") == 2
    assert "--seed is -1; it must be 0 or more" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def npz(**arrays: list[float]) -> bytes:
    """The content of a .npz file with these arrays."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **{name: np.array(values) for name, values in arrays.items()})
    return file.getvalue()


def test_fits_are_compared_by_bytes_then_by_numbers():
    ours = npz(a=[1.0, 2.0, 5.0], b=[1.0])
    assert compared(ours, ours) == "byte for byte the shipped file"
    assert "all numbers are as in the shipped file" in compared(npz(b=[1.0], a=[1.0, 2.0, 5.0]), ours)
    line = compared(npz(a=[1.0, 3.0, 5.0], b=[1.0]), ours)
    assert "1 of 4 numbers differ, by at most 0.2 of the largest in their array (a)" in line
    assert "a have another shape" in compared(npz(a=[1.0], b=[1.0]), ours)


def test_the_nearest_recorded_reach_is_another_one(straight: Reach):
    beside = replace(straight, positions=straight.positions + np.array([0.0, 0.0, 0.03]))
    table = nearest_recorded([straight, beside], [replace(straight), straight]).set_index("source")
    assert list(table["least"]) == [pytest.approx(0.03), pytest.approx(0.0, abs=1e-12)]


def test_a_single_feature_shows_a_change_of_duration(reaches: list[Reach]):
    slow = replace(reaches[0], times=reaches[0].times * 2, reached=reaches[0].reached * 2)
    table = single_feature_aucs([reaches[0], slow], [slow]).set_index("group")
    assert table.loc["durations", "high"] == 0.75  # Above one of two, equal to the other.
    assert table.loc["durations", "low"] == pytest.approx(0.5)  # The share until the hand arrives is the same in all.


@pytest.mark.slow
def test_fit_reproduces_the_shipped_model(opened: Callable[[str], Source], tmp_path: Path):
    """Numbers agree except for rounding, and except for the signs of components, which are arbitrary."""
    file = tmp_path / "new" / "model.npz"
    opened("real")
    places = {"DEXTRON_CACHE": str(recorded_cache.cache_folder()), "DEXTRON_DATA": os.environ.get("DEXTRON_DATA", "")}
    done = shell(["-m", "tools.fit_synthetic", "--into", str(file)], tmp_path, **places)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"{file}: {file.stat().st_size:,} bytes, ")
    assert "shipped file" in done.stdout
    model = load(str(file))
    for name in ("regions", "sessions", "slopes", "left", "subject_scales", "lags", "noise"):
        np.testing.assert_allclose(getattr(model, name), getattr(shipped_parameters(), name), rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(abs(model.components), abs(shipped_parameters().components), rtol=0.01, atol=1e-4)


@pytest.mark.slow
def test_likeness_prints_json_and_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    done = shell(["-c", STUDY, "data", "likeness", "--json"], tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    tables = json.loads(done.stdout)
    assert list(tables) == ["held out", "alone", "nearest", "distributions", "strangers"]
    assert len(tables["held out"]) == 6 * 2 * (1 + 4 + 4 + 16)
    assert len(tables["strangers"]) == 6 * 2 * 2
    assert {(row["real"], row["synthetic"]) for row in tables["held out"] if row["stratum"] == "all"} == {(48, 96)}
    assert tables["nearest"][1]["least"] == 0.0  # The made-up recordings are shipped reaches.
    print_likeness({name: pd.DataFrame(rows) for name, rows in tables.items()})
    printed = capsys.readouterr().out
    for row in tables["held out"]:
        if row["stratum"] == "all":
            assert f"{row['auc']:.2f} [{row['low']:.2f}, {row['high']:.2f}]" in printed
        elif row["classifier"] == "forest":
            assert f"{row['auc']:.2f} ±{(row['high'] - row['low']) / 2:.2f}" in printed


def shell(words: list[str], folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs the interpreter in a new process."""
    inherited = {key: value for key, value in os.environ.items() if not key.startswith("DEXTRON_")}
    cache = {"DEXTRON_CACHE": str(folder / "cache")}
    command, variables = [sys.executable, *words], {**inherited, **cache, **environment}
    return subprocess.run(command, env=variables, capture_output=True, text=True, timeout=600)
