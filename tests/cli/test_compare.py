"""`dextron-bench compare` on made-up results: what it prints, its exit codes, and how results are named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dextron_bench.cli import main
from dextron_bench.splits import strata
from dextron_bench.splits.loading import load_split

SPLIT = load_split("real", "test")
ROWS = len(SPLIT.cases)


def write(folder: Path, method: str, scores: list[float] | np.ndarray, seed: int = 0, **changed: Any) -> None:
    """Writes a result of a run on `test` of real reaches, or of what is changed, into a folder of runs."""
    about = {"method": method, "reaches": "real", "seed": seed, "digest": SPLIT.digest, "split": "test"} | changed
    found = {"digest": about["digest"], "scores": list(scores), "failed": 0, "causes": {}, "closing_lag": None}
    place = folder / method / about["reaches"] / f"seed{seed}" / "result.json"
    place.parent.mkdir(parents=True)
    place.write_text(json.dumps({**about, "splits": {about["split"]: found}}))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with runs of `good`, which solves all rows but 0 and 1, and of `bad`, all but 1 to 20."""
    rows = np.arange(ROWS)
    write(tmp_path / "runs", "good", np.where(rows < 2, 0.0, 20.0))
    write(tmp_path / "runs", "bad", np.where((rows >= 1) & (rows <= 20), 0.0, 20.0))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def compared(here: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., dict[str, Any]]:
    """What a comparison says as JSON."""

    def run(*words: str) -> dict[str, Any]:
        assert main.main(["compare", *words, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return run


def test_the_difference_flips_and_groups_are_told(compared: Callable[..., dict[str, Any]]):
    """`bad` loses rows 2 to 20 and gains row 0: 18 of 500 rows of 20, or 3.6 %."""
    found = compared("good", "bad")
    assert (found["a"], found["b"], found["seeds"], found["rows"]) == ("good", "bad", [1, 1], 500)
    assert found["return"]["mean"] == pytest.approx(-0.72)
    assert found["return"]["low"] < -0.72 < found["return"]["high"] < 0.0
    assert found["success"]["mean"] == pytest.approx(-0.036)
    assert found["worse"] is True
    assert found["p_value"] == pytest.approx(2 * (1 + 20) / 2**20)
    assert [(row["row"], row["gained"]) for row in found["flips"]] == [(0, True), *((k, False) for k in range(2, 21))]


def test_groups_are_the_split_s_subjects_and_regions(compared: Callable[..., dict[str, Any]]):
    rows, groups = strata.strata(SPLIT), compared("good", "bad")["groups"]
    by_name = {group["group"]: group for group in groups}
    assert by_name["all"]["difference"] == pytest.approx(-0.72)
    for kind in ("subject", "ring"):
        own = [group for group in groups if group["group"].startswith(kind)]
        assert sum(group["rows"] for group in own) == ROWS
        assert sum(group["rows"] * group["difference"] for group in own) == pytest.approx(-0.72 * ROWS)
    first = rows.iloc[0]
    mine = by_name[f"subject {first['subject']}"]
    own = np.flatnonzero(rows["subject"] == first["subject"])
    lost = int(((own >= 2) & (own <= 20)).sum())
    assert mine["difference"] == pytest.approx(20.0 * (1 - lost) / len(own))


def test_swapping_the_two_swaps_the_sign(compared: Callable[..., dict[str, Any]]):
    there, back = compared("good", "bad"), compared("bad", "good")
    assert there["return"]["low"] == pytest.approx(-back["return"]["high"])
    assert back["worse"] is False


@pytest.mark.parametrize(
    ("a", "b", "flag", "code"),
    [
        ("good", "bad", True, 1),
        ("good", "bad", False, 0),
        ("bad", "good", True, 0),
        ("good", "good", True, 0),
    ],
)
def test_the_exit_code_says_worse_only_where_asked(here: Path, a: str, b: str, flag: bool, code: int):
    assert main.main(["compare", a, b, *(["--fail-if-worse"] if flag else [])]) == code


def test_worse_within_noise_does_not_fail(here: Path):
    rows = np.arange(ROWS)
    write(here / "runs", "unlucky", np.where(rows < 4, 0.0, 20.0))  # Rows 2 and 3 are lost, and no other.
    assert main.main(["compare", "good", "unlucky", "--fail-if-worse"]) == 0


def test_what_is_printed_names_rows_and_numbers(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(["compare", "good", "bad"]) == 0
    printed = capsys.readouterr().out
    assert "-0.72 [-" in printed
    assert "1 of 500 settings are solved by more seeds of B: rows 0\n" in printed
    assert "19 of 500 settings are solved by fewer seeds of B: rows 2, 3, 4, 5, 6, ...\n" in printed
    assert "p = 4.01e-05" in printed


def test_published_results_stand_in_and_runs_come_first(compared: Callable[..., dict[str, Any]], here: Path):
    write(here / "leaderboard/results", "good", [0.0] * ROWS)
    write(here / "leaderboard/results", "published", [20.0] * ROWS)
    assert compared("good", "published")["return"]["mean"] == pytest.approx(0.08)


@pytest.mark.parametrize(
    "path", ["old/good/real/seed0/result.json", "old/good/real/seed0", "old/good/real", "old/good"]
)
def test_a_path_names_a_result_too(compared: Callable[..., dict[str, Any]], here: Path, path: str):
    write(here / "old", "good", [10.0] * ROWS)
    found = compared(path, "good")
    assert (found["a"], found["return"]["mean"]) == (path, pytest.approx(9.92))


def test_all_seeds_of_a_method_count(compared: Callable[..., dict[str, Any]], here: Path):
    for seed in range(3):
        write(here / "runs", "three", [20.0 * (seed > 0)] * ROWS, seed)
    found = compared("good", "three")
    assert found["seeds"] == [1, 3]
    assert found["return"]["mean"] == pytest.approx(40.0 / 3 - 19.92)


def test_a_version_that_does_not_ship_is_compared_without_its_groups(
    compared: Callable[..., dict[str, Any]], here: Path
):
    for name in ("one", "other"):
        write(here / "runs", name, [1.0, 2.0], digest="a" * 64)
    assert [group["group"] for group in compared("one", "other")["groups"]] == ["all"]


@pytest.mark.parametrize("format", ["png", "svg"])
def test_a_picture_is_drawn(here: Path, format: str):
    assert main.main(["compare", "good", "bad", "--into", f"difference.{format}"]) == 0
    content = (here / f"difference.{format}").read_bytes()
    assert len(content) > 10_000
    assert content.startswith(b"\x89PNG") if format == "png" else b"<svg" in content


def test_what_cannot_be_compared_is_told_in_a_line(here: Path, complaint: Callable[..., str]):
    write(here / "runs", "older", [0.0] * ROWS, digest="b" * 64)
    write(here / "runs", "elsewhere", [0.0], reaches="synthetic")
    write(here / "runs", "short", [0.0] * 3)
    write(here / "runs", "uneven", [0.0] * ROWS)
    write(here / "runs", "uneven", [0.0] * ROWS, seed=1, digest="b" * 64)
    for folder in ("both", "too"):
        write(here / "runs", folder, [0.0])
        write(here / "runs", folder, [0.0], reaches="synthetic")
    expected = {
        ("good", "godo"): "no result of 'godo'; runs and leaderboard/results have bad, both, elsewhere, good",
        ("good", "no/where"): "no result of 'no/where'",
        ("good", "older"): "played other versions of test of real reaches",
        ("good", "short"): "played other versions of test of real reaches",
        ("good", "uneven"): "seeds of uneven played other versions of test",
        ("good", "elsewhere"): "A has results on real reaches, B on synthetic: none in common",
        ("both", "too"): "both have results on real, synthetic reaches; choose with --reaches",
        ("good", "bad", "--reaches", "minjerk"): "both have results on real reaches, not both on minjerk",
        ("good", "bad", "--split", "val"): "good, seed 0, has no split 'val' of real reaches; it has test",
        ("good", "bad", "--into", "difference.gif"): "no picture format '.gif'",
        ("good",): "required",
    }
    for words, line in expected.items():
        assert line in complaint("compare", *words)


def test_a_damaged_result_is_named(here: Path, complaint: Callable[..., str]):
    (here / "runs/bad/real/seed0/result.json").write_text("{")
    assert "runs/bad/real/seed0/result.json is damaged" in complaint("compare", "good", "bad")


def test_a_folder_of_several_methods_is_no_side(here: Path, complaint: Callable[..., str]):
    for seed, name in enumerate(("x", "y")):
        write(here / "made", "mixed", [0.0], seed)
        file = here / f"made/mixed/real/seed{seed}/result.json"
        file.write_text(file.read_text().replace("mixed", name))
    assert "holds results of x, y; give one of them" in complaint("compare", "good", "made/mixed")
