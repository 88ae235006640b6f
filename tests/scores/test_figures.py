"""Equal figures give equal bytes, at any time and in any format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from dextron_bench.evaluation.closing_windows import Choice, Window
from dextron_bench.scores import comparison
from dextron_bench.scores.figures import differences, episodes, pictures, training


@pytest.mark.parametrize("suffix", [".pdf", ".svg", ".png"])
def test_equal_comparisons_give_equal_bytes(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    scores = np.random.default_rng(0).choice([0.0, 20.0], (2, 3, 20))
    a, b = (comparison.SeedScores(name, "real", "test", "a" * 64, scores[k]) for k, name in enumerate("ab"))
    files = [tmp_path / f"{name}{suffix}" for name in ("today", "tomorrow")]
    for day, file in enumerate(files):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", str(86_400 * day))  # Matplotlib takes its date from here.
        differences.differences(comparison.compare(a, b), file)
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_last_bits_of_a_layout_change_no_byte(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The solver of the layout gives other last bits in other places of the memory."""
    lay_out = Figure.draw_without_rendering

    def shifted(figure: Figure) -> None:
        lay_out(figure)
        for part in figure.subfigs:
            part.bbox_relative.set_points(part.bbox_relative.get_points() * (1.0 + 1e-13))
        for axes in figure.axes:
            axes.set_position(axes.get_position().translated(1e-13, -1e-13))

    files = [tmp_path / f"{name}{suffix}" for name in ("here", "there")]
    for file in files:
        figure = Figure(figsize=(4, 4), layout="constrained")
        for part in figure.subfigures(2, 1, squeeze=False)[:, 0]:
            part.subplots().plot([0.0, 1.0], [0.3, 0.7])
        pictures.save(figure, file, 150)
        monkeypatch.setattr(Figure, "draw_without_rendering", shifted)
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_picture_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def write_half(self: Figure, file: Path, **options: object) -> None:
        file.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    picture = tmp_path / "picture.png"
    picture.write_bytes(b"old")
    monkeypatch.setattr(Figure, "savefig", write_half)
    point: dict[str, float] = dict.fromkeys(("epoch", "loss", "accuracy", "test_loss", "test_accuracy"), 1.0)
    with pytest.raises(OSError, match="No space left") as caught:
        training.success_curve([point], picture)
    assert caught.value.filename == str(picture)
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [("picture.png", b"old")]


def test_an_unknown_format_lists_the_known_ones(tmp_path: Path):
    with pytest.raises(pictures.UnknownFormat, match=r"difference\.gif: .*'\.gif'.*\.pdf, \.png, \.svg"):
        training.success_curve([{"epoch": 1.0}], tmp_path / "difference.gif")


def test_windows_are_drawn_also_for_settings_that_never_work_and_for_hands_that_never_came_near(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    never = np.zeros(0)
    windows = {
        3: Window(np.array([1.0, 1.04, 1.08]), np.array([False, True, False])),
        5: Window(np.array([2.0]), np.array([False])),
        8: Window(never, never.astype(bool)),
    }
    unseen, by_row = Choice(0.0, True), {3: Choice(1.04, True), 5: Choice(2.0, False), 8: Choice(np.nan, False)}
    choices = {"rule": [by_row.get(row, unseen) for row in range(9)]}
    drawn: list[Figure] = []
    monkeypatch.setattr(episodes, "save", lambda figure, file, dpi: drawn.append(figure))
    episodes.windows(windows, choices, "title", tmp_path / "windows.svg")
    (axes,) = drawn[0].axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["3", "5", "8"]
    marks = [(line.get_xdata()[0], line.get_markerfacecolor()) for line in axes.lines[:2]]  # type: ignore[index]
    assert marks == [(pytest.approx(0.04), "C0"), (0.0, "white")]


def test_a_part_of_a_training_is_not_drawn_beside_the_whole():
    labels = ["rl-quick", "rl-tenth", "rl", "rlil-0.1-quick", "rlpd-tenth", "exp"]
    assert training.without_parts(labels) == ["exp", "rl", "rlil-0.1-quick", "rlpd-tenth"]


def test_learning_curves_show_the_median_over_seeds_and_each_seed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Of three seeds, one fails from epoch 20 on; `bc` has one seed, and so no panel of its own."""
    returns = {0: [2.0, 18.0], 1: [4.0, 0.0], 2: [6.0, 16.0]}
    curves = {
        "rl": {seed: pd.DataFrame({"epoch": [10, 20], "return": values}) for seed, values in returns.items()},
        "bc": {0: pd.DataFrame({"epoch": [10, 20], "return": [1.0, 3.0]})},
    }
    drawn: list[Figure] = []
    monkeypatch.setattr(training, "save", lambda figure, file, dpi: drawn.append(figure))
    rows = pd.DataFrame([{"split": "test", "method": "exp", "return": 20.0}])
    training.learning_curves(curves, rows, tmp_path / "curves.png")
    overview, panel = drawn[0].axes
    assert [np.asarray(line.get_ydata()).tolist() for line in overview.lines[:2]] == [[1.0, 3.0], [4.0, 16.0]]
    assert overview.get_legend_handles_labels()[1] == ["bc (1 seed)", "rl (3 seeds)", "exp (on test)"]
    assert panel.get_title() == "rl"
    assert [np.asarray(line.get_ydata()).tolist() for line in panel.lines] == list(returns.values())
