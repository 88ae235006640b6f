"""Damaged files: every command ends with one line that names the file, never with code 70."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from baselines import demonstrations
from dextron_bench.cli import main
from dextron_bench.methods import weights
from dextron_bench.methods.learners import TrainingSetup
from dextron_bench.splits.loading import load_split
from dextron_bench.storage.atomic import DamagedFile
from tests.helpers import tiny_benchmark, tiny_training
from tests.helpers.short_reaches import SOURCE

TOY = ["--method", "tests.helpers.toy_learner:Toy", "--preset", "quick", "--quiet", "--record", "0"]
SHOW, BUILD = ["leaderboard", "show"], ["leaderboard", "build", "--runs", "runs", "--board", "board"]
RUN, AGAIN = ["run", *TOY], ["run", *TOY, "--split", "val"]
SEED = "runs/toy-0.1/synthetic/seed0"
TRAINING = "runs/toy-0.1/synthetic/training-0"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a finished run of the toy learner on the tiny benchmark, which stays until the last test."""
    folder = tmp_path_factory.mktemp("finished")
    with pytest.MonkeyPatch.context() as patch:
        tiny_training.install(tiny_training.write(folder / "data"), patch.setattr)
        patch.chdir(folder)
        patch.setattr(weights, "shipped_folder", lambda learner, reaches: folder / "shipped" / learner.label / reaches)
        assert main.main(RUN) == 0
        yield folder
    tiny_benchmark.forget()


@pytest.fixture
def here(finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the finished run, in the working folder."""
    shutil.copytree(finished / "runs", tmp_path / "runs")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def changed(file: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Changes the content of a JSON file."""
    content = json.loads(file.read_text())
    file.write_text(json.dumps(change(content) or content))


def first_split(result: dict[str, Any], **values: Any) -> None:
    result["splits"]["test"] |= values


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change", "command"),
    [
        *[("curve.json", lambda _, value=value: [value], BUILD) for value in (None, "text")],
        ("curve.json", lambda curve: curve.update(points=None), BUILD),
        ("curve.json", lambda curve: curve["points"][0].update({"return": "high"}), BUILD),
        ("result.json", lambda result: result.update(method=None), SHOW),
        ("result.json", lambda result: first_split(result, closing_lag="soon"), SHOW),
        *[
            ("result.json", lambda result, score=score: first_split(result, scores=[score, 0.0]), SHOW)
            for score in (float("nan"), 1e308, -5.0)
        ],
        ("config.json", lambda config: config.pop("code") and None, BUILD),
        ("config.json", lambda config: config.update(code=None), BUILD),
        ("config.json", lambda config: config["settings"].update(rate=0.5), BUILD),
    ],
)
def test_a_json_file_with_wrong_values_is_named(
    here: Path, complaint: Callable[..., str], name: str, change: Any, command: list[str]
):
    changed(here / SEED / name, change)
    assert re.search(rf"{SEED}/{name} is damaged( or of another version)? \(", complaint(*command))


def test_settings_that_the_method_does_not_know_are_one_line(here: Path, complaint: Callable[..., str]):
    changed(here / SEED / "config.json", lambda config: config["settings"].update(preset="qumck"))
    assert f"with the settings in {SEED}/config.json" in complaint(*BUILD)
    assert not (here / "board").exists()


@pytest.mark.parametrize("column", ["split", "score", "failure", "cause", "closing_lag"])
def test_a_table_without_a_column_is_named(here: Path, complaint: Callable[..., str], column: str):
    file = here / SEED / "episodes.parquet"
    pd.read_parquet(file).drop(columns=column).to_parquet(file)
    assert f"{SEED}/episodes.parquet is damaged or of another version (it lacks the column {column!r})" in complaint(
        *RUN
    )


def test_a_timing_file_that_is_not_text_is_passed_over(here: Path):
    (here / TRAINING / "timing.jsonl").write_bytes(b"\xff\xfe\x00\n[]\n")
    assert main.main(RUN) == 0
    assert "seconds" not in json.loads((here / SEED / "result.json").read_text())["provenance"]


@pytest.mark.parametrize("content", ["", "[]", "{}", "null", '{"search": []}'])
def test_a_damaged_search_is_named(here: Path, complaint: Callable[..., str], content: str):
    folder = here / "runs/mc/synthetic/seed0"
    folder.mkdir(parents=True)
    (folder / "search.json").write_text(content)
    assert "runs/mc/synthetic/seed0" in complaint("data", "mc", "--rows", "1", "--threads", "1")


def test_a_name_that_is_not_utf_8_is_refused(here: Path, complaint: Callable[..., str]):
    name = os.fsdecode(b"r\xffns")
    assert "'r\\udcffns' is not valid UTF-8; rename the file or folder" in complaint(*SHOW, "--runs", name)


def test_a_name_on_the_disk_that_is_not_utf_8_is_one_line():
    error = UnicodeEncodeError("utf-8", "r\udcffns", 1, 2, "surrogates not allowed")
    assert main.explain(error) == (2, "'r\\udcffns' is not valid UTF-8; rename the file or folder")


@pytest.mark.parametrize("damage", [lambda content: b"", lambda content: content[:-1] + bytes([content[-1] ^ 1])])
def test_a_damaged_cache_of_demonstrations_is_named(finished: Path, tmp_path: Path, damage: Callable[[bytes], bytes]):
    setup = TrainingSetup(SOURCE, load_split("synthetic", "train").cases, tmp_path / "cache", 1, "cpu")
    whole = demonstrations.load(setup)
    [file] = (tmp_path / "cache").iterdir()
    assert len(demonstrations.load(setup)) == len(whole) == 2
    file.write_bytes(damage(file.read_bytes()))
    with pytest.raises(DamagedFile, match=rf"{file.name} is damaged .*remove it and run again"):
        demonstrations.load(setup)


@pytest.mark.slow
def test_a_hidden_folder_is_never_published(here: Path):
    """A killed `leaderboard add` of an earlier version leaves such a folder in the results."""
    assert main.main(BUILD) == 0
    before = (here / "board/table.csv").read_bytes()
    for name in (".toy-0.1.part", "toy-0.1/.synthetic.part", "toy-0.1/synthetic/.seed0.part"):
        shutil.copytree(here / SEED, here / "board/results" / name / "synthetic" / "seed7")
        shutil.copytree(here / SEED, here / "board/results" / name / "seed7")
    assert main.main(["leaderboard", "build", "--board", "board"]) == 0
    assert (here / "board/table.csv").read_bytes() == before


def test_weights_with_a_flipped_bit_are_neither_used_nor_published(here: Path, complaint: Callable[..., str]):
    file = here / SEED / "weights.safetensors"
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(content)
    assert "it is not the file that the result names" in complaint(*BUILD)
    assert "differ from the digest that it carries" in complaint(*AGAIN)


@pytest.mark.parametrize("name", ["episodes.parquet", "result.json", "config.json"])
def test_a_damaged_run_is_one_line_with_the_file(tiny_world: Path, complaint: Callable[..., str], name: str):
    words = ["run", "--method", "nothing", "--split", "open", "--quiet"]
    assert main.main(words) == 0
    file = tiny_world / "runs" / "nothing" / "synthetic" / "seed0" / name
    file.write_bytes(file.read_bytes()[:20])
    line = complaint(*(["leaderboard", "show"] if name == "result.json" else words))
    assert f"runs/nothing/synthetic/seed0/{name} is damaged" in line
    assert "remove it and run again" in line
    file.unlink()
    if name != "config.json":
        assert main.main(words) == 0  # As the line said.


def test_a_damaged_split_is_one_line(tiny_world: Path, complaint: Callable[..., str]):
    file = tiny_world / "data" / "splits-synthetic.parquet"
    file.write_bytes(file.read_bytes()[:100])
    assert "reinstall the package" in complaint("run", "--method", "nothing", "--split", "test", "--quiet")
    assert "reinstall the package" in complaint("data", "splits")
