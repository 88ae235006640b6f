"""`dextron-bench compare` on invented results: its output, its exit codes, and the names of results."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dextron_bench.cli import main
from dextron_bench.runs import result_files
from dextron_bench.splits import strata
from dextron_bench.splits.loading import load_split

SPLIT = load_split("real", "test")
ROWS = len(SPLIT.cases)


def write(folder: Path, method: str, scores: list[float] | np.ndarray, seed: int = 0, **changed: Any) -> None:
    """Writes the result of a run on `test` of real reaches into a folder of runs; `changed` replaces its properties."""
    about = {"method": method, "reaches": "real", "seed": seed, "digest": SPLIT.digest, "split": "test"} | changed
    split = {"digest": about["digest"], "scores": list(scores), "failed": 0, "causes": {}, "closing_lag": None}
    file = folder / method / about["reaches"] / f"seed{seed}" / "result.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps({**about, "splits": {about["split"]: split}}))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with two runs: `good` solves all rows except 0 and 1, `bad` all rows except 1 to 20."""
    rows = np.arange(ROWS)
    write(tmp_path / "runs", "good", np.where(rows < 2, 0.0, 20.0))
    write(tmp_path / "runs", "bad", np.where((rows >= 1) & (rows <= 20), 0.0, 20.0))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(result_files, "published_results", lambda: tmp_path / "published")
    return tmp_path


@pytest.fixture
def compared(here: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., dict[str, Any]]:
    """Runs a comparison and returns its JSON."""

    def run(*arguments: str) -> dict[str, Any]:
        assert main.main(["compare", *arguments, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return run


def test_the_difference_and_the_flips_are_printed(compared: Callable[..., dict[str, Any]]):
    """`bad` loses rows 2 to 20 and gains row 0: 18 of 500 rows of 20, or 3.6 %."""
    result = compared("good", "bad")
    assert (result["a"], result["b"], result["seeds"], result["rows"]) == ("good", "bad", [1, 1], 500)
    assert result["return"]["mean"] == pytest.approx(-0.72)
    assert result["return"]["low"] < -0.72 < result["return"]["high"] < 0.0
    assert result["success"]["mean"] == pytest.approx(-0.036)
    assert result["worse"] is True
    assert result["p_value"] == pytest.approx(2 * (1 + 20) / 2**20)
    assert [(row["row"], row["gained"]) for row in result["flips"]] == [(0, True), *((k, False) for k in range(2, 21))]


def test_groups_are_the_subjects_and_regions_of_the_split(compared: Callable[..., dict[str, Any]]):
    rows, groups = strata.strata(SPLIT), compared("good", "bad")["groups"]
    by_name = {group["group"]: group for group in groups}
    assert by_name["all"]["difference"] == pytest.approx(-0.72)
    for kind in ("subject", "ring"):
        members = [group for group in groups if group["group"].startswith(kind)]
        assert sum(group["rows"] for group in members) == ROWS
        assert sum(group["rows"] * group["difference"] for group in members) == pytest.approx(-0.72 * ROWS)
    first = rows.iloc[0]
    group = by_name[f"subject {first['subject']}"]
    numbers = np.flatnonzero(rows["subject"] == first["subject"])
    lost = int(((numbers >= 2) & (numbers <= 20)).sum())
    assert group["difference"] == pytest.approx(20.0 * (1 - lost) / len(numbers))


def test_swapping_the_two_swaps_the_sign(compared: Callable[..., dict[str, Any]]):
    forward, backward = compared("good", "bad"), compared("bad", "good")
    assert forward["return"]["low"] == pytest.approx(-backward["return"]["high"])
    assert backward["worse"] is False


@pytest.mark.parametrize(
    ("a", "b", "flag", "code"),
    [
        ("good", "bad", True, 1),
        ("good", "bad", False, 0),
        ("bad", "good", True, 0),
        ("good", "good", True, 0),
    ],
)
def test_the_exit_code_is_1_only_if_b_is_worse_and_the_flag_is_set(here: Path, a: str, b: str, flag: bool, code: int):
    assert main.main(["compare", a, b, *(["--fail-if-worse"] if flag else [])]) == code


def test_worse_within_noise_does_not_fail(here: Path):
    rows = np.arange(ROWS)
    write(here / "runs", "unlucky", np.where(rows < 4, 0.0, 20.0))  # B loses rows 2 and 3 only.
    assert main.main(["compare", "good", "unlucky", "--fail-if-worse"]) == 0


def test_the_printed_text_has_rows_and_numbers(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(["compare", "good", "bad"]) == 0
    printed = capsys.readouterr().out
    assert "-0.72 [-" in printed
    assert "1 of 500 settings are solved by more seeds of B: rows 0\n" in printed
    assert "19 of 500 settings are solved by fewer seeds of B: rows 2, 3, 4, 5, 6, ...\n" in printed
    assert "p = 4e-05\n" in printed


def test_groups_have_p_values_that_are_corrected_for_their_number(compared: Callable[..., dict[str, Any]]):
    total, *groups = compared("good", "bad")["groups"]
    assert total["p_holm"] == total["p_value"] < 0.05
    smallest = min(groups, key=lambda group: group["p_value"])
    assert smallest["p_holm"] == pytest.approx(min(1.0, len(groups) * smallest["p_value"]))
    assert all(group["p_value"] <= group["p_holm"] <= 1.0 for group in groups)


def test_three_methods_are_compared_in_pairs(compared: Callable[..., dict[str, Any]], here: Path):
    """`good` and `same` have equal scores; the other two p values are equal, and the smallest counts three times."""
    write(here / "runs", "same", np.where(np.arange(ROWS) < 2, 0.0, 20.0))
    result = compared("good", "bad", "same")
    assert result["seeds"] == {"good": 1, "bad": 1, "same": 1}
    pairs = {(pair["a"], pair["b"]): pair for pair in result["pairs"]}
    assert list(pairs) == [("good", "bad"), ("good", "same"), ("bad", "same")]
    assert [pair["difference"] for pair in result["pairs"]] == pytest.approx([-0.72, 0.0, 0.72])
    assert [pair["success"] for pair in result["pairs"]] == pytest.approx([-0.036, 0.0, 0.036])
    first = pairs["good", "bad"]
    assert first["p_value"] == pairs["bad", "same"]["p_value"] < 0.001
    assert first["p_holm"] == pytest.approx(3 * first["p_value"])
    assert pairs["good", "same"]["p_holm"] == 1.0


def test_the_table_of_pairs_says_which_methods_differ(here: Path, capsys: pytest.CaptureFixture[str]):
    write(here / "runs", "same", np.where(np.arange(ROWS) < 2, 0.0, 20.0))
    assert main.main(["compare", "good", "bad", "same"]) == 0
    printed = capsys.readouterr().out
    assert "3 pairs; p (Holm) is corrected for all of them" in printed
    assert [line.rstrip(" │").split("│")[-1].strip() for line in printed.splitlines()[-4:-1]] == [
        *("differ", "within noise", "differ")
    ]


def test_published_results_are_used_if_there_is_no_run(compared: Callable[..., dict[str, Any]], here: Path):
    write(here / "published", "good", [0.0] * ROWS)
    write(here / "published", "published", [20.0] * ROWS)
    assert compared("good", "published")["return"]["mean"] == pytest.approx(0.08)


@pytest.mark.parametrize(
    "path", ["old/good/real/seed0/result.json", "old/good/real/seed0", "old/good/real", "old/good"]
)
def test_a_path_selects_a_result_too(compared: Callable[..., dict[str, Any]], here: Path, path: str):
    write(here / "old", "good", [10.0] * ROWS)
    result = compared(path, "good")
    assert (result["a"], result["return"]["mean"]) == (path, pytest.approx(9.92))


def test_all_seeds_of_a_method_count(compared: Callable[..., dict[str, Any]], here: Path):
    for seed in range(3):
        write(here / "runs", "three", [20.0 * (seed > 0)] * ROWS, seed)
    result = compared("good", "three")
    assert result["seeds"] == [1, 3]
    assert result["return"]["mean"] == pytest.approx(40.0 / 3 - 19.92)


def test_a_split_version_that_does_not_ship_has_no_groups(compared: Callable[..., dict[str, Any]], here: Path):
    for name in ("one", "other"):
        write(here / "runs", name, [1.0, 2.0], digest="a" * 64)
    assert [group["group"] for group in compared("one", "other")["groups"]] == ["all"]


@pytest.mark.slow
@pytest.mark.parametrize("format", ["png", "svg"])
def test_a_picture_is_drawn(here: Path, format: str):
    assert main.main(["compare", "good", "bad", "--into", f"difference.{format}"]) == 0
    content = (here / f"difference.{format}").read_bytes()
    assert len(content) > 10_000
    assert content.startswith(b"\x89PNG") if format == "png" else b"<svg" in content


def test_an_impossible_comparison_is_one_line_on_stderr(here: Path, complaint: Callable[..., str]):
    write(here / "runs", "older", [0.0] * ROWS, digest="b" * 64)
    write(here / "runs", "elsewhere", [0.0], reaches="synthetic")
    write(here / "runs", "short", [0.0] * 3)
    write(here / "runs", "uneven", [0.0] * ROWS)
    write(here / "runs", "uneven", [0.0] * ROWS, seed=1, digest="b" * 64)
    write(here / "runs", "more", [0.0] * ROWS)
    write(here / "runs", "more", [0.0] * ROWS, seed=1, split="val")
    for folder in ("both", "too"):
        write(here / "runs", folder, [0.0])
        write(here / "runs", folder, [0.0], reaches="synthetic")
    expected = {
        ("good", "godo"): "no result of 'godo': runs has bad, both, elsewhere, good",
        ("good", "no/where"): "no result of 'no/where'",
        ("good", "older"): "played different versions of test of real reaches",
        ("good", "short"): "played different versions of test of real reaches",
        ("good", "uneven"): "the seeds of uneven played different versions of test",
        ("good", "elsewhere"): "A has results on real reaches, B on synthetic reaches: no source is common to both",
        ("both", "too"): "both have results on real, synthetic reaches; choose one with --reaches",
        ("good", "bad", "--reaches", "minjerk"): "both have results on real reaches, but not both on minjerk reaches",
        ("good", "bad", "--split", "val"): "good, seed 0, has no split 'val' of real reaches; it has test",
        ("good", "more"): "it has val; other seeds have it: to compare one of them, give its folder",
        ("good", "bad", "--into", "difference.gif"): "no picture format '.gif'",
        ("good",): "B is missing",
        ("good", "bad", "short"): "played different versions of test of real reaches",
        ("good", "bad", "good", "--fail-if-worse"): "--into and --fail-if-worse need two methods, not more",
    }
    for arguments, line in expected.items():
        assert line in complaint("compare", *arguments)


def test_a_damaged_result_is_named(here: Path, complaint: Callable[..., str]):
    (here / "runs/bad/real/seed0/result.json").write_text("{")
    assert "runs/bad/real/seed0/result.json is damaged" in complaint("compare", "good", "bad")


def test_a_folder_with_several_methods_is_refused(here: Path, complaint: Callable[..., str]):
    for seed, name in enumerate(("x", "y")):
        write(here / "made", "mixed", [0.0], seed)
        file = here / f"made/mixed/real/seed{seed}/result.json"
        file.write_text(file.read_text().replace("mixed", name))
    assert "holds results of x, y; give one of them" in complaint("compare", "good", "made/mixed")
