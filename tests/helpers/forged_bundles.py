"""Submissions to a tiny benchmark, and forgeries of them: changed bundles with correct hashes."""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from msgspec import to_builtins

from dextron_bench.evaluation.results import scores_by_split
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.runs import run_files
from dextron_bench.storage import hashing
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.submissions import bundle, playing, verification
from dextron_bench.submissions import entry as submission_entry
from dextron_bench.submissions.seed_check import Playing
from dextron_bench.submissions.verdict import Verdict
from tests.helpers import tiny_benchmark

AGENT = """
import numpy as np
from dextron_bench.world import task


class Near:
    name = "near"

    def __init__(self, near=0.06):
        self.near = near

    def agent(self, seed):
        return self

    def reset(self, episodes):
        pass

    def act(self, states):
        return np.where(task.distance(states) <= self.near, 1.0, -1.0)[:, None]
"""
ROWS = pd.concat(
    [tiny_benchmark.ROWS, pd.DataFrame([("test", *tiny_benchmark.FALLS)], columns=tiny_benchmark.COLUMNS)],
    ignore_index=True,
)


@dataclass
class Forgery:
    """An unpacked submission, to be changed and packed again with correct hashes."""

    folder: Path
    board: Path

    @property
    def seed(self) -> Path:
        return self.folder / "seed0"

    def table(self, change: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
        """Changes the table of episodes."""
        run = RunFolder(self.seed)
        run_files.store_episodes(run, change(pd.read_parquet(run.episodes)))

    def json(self, name: str, change: Callable[[dict[str, Any]], object]) -> None:
        """Changes a JSON file."""
        value = json.loads((self.folder / name).read_text())
        change(value)
        (self.folder / name).write_text(json.dumps(value))

    def conclude(self) -> None:
        """Computes the result of the changed episodes."""
        table = pd.read_parquet(RunFolder(self.seed).episodes)
        self.json("seed0/result.json", lambda result: result.update(splits=to_builtins(scores_by_split(table))))

    def checked(self, *, rerun: bool = False, **how: Any) -> Verdict:
        """Packs the bundle with correct hashes, and verifies it; `how` are fields of `Playing`."""
        manifest = json.loads((self.folder / bundle.MANIFEST).read_text())
        files = {str(path.relative_to(self.folder)): path for path in self.folder.rglob("*") if path.is_file()}
        hashes = {name: hashing.sha256(path) for name, path in files.items() if name != bundle.MANIFEST}
        packed = self.folder.with_suffix(".zip")
        with zipfile.ZipFile(packed, "w") as archive:
            archive.writestr(bundle.MANIFEST, json.dumps(manifest | {"files": hashes}))
            for name in hashes:
                archive.write(files[name], name)
        into = self.folder.with_name("again")
        shutil.rmtree(into, ignore_errors=True)
        return verification.verify(into, bundle.unpack(packed, into), self.board, Playing(threads=1, **how), rerun)


def play(here: Path) -> Path:
    """Plays an agent on a tiny benchmark with two seeds; packs near.zip, with the first, and twins.zip with both."""
    tiny_benchmark.write(here / "splits", ROWS)
    (here / "near.py").write_text(AGENT)
    with installed(here):
        twins = entry_of(here, (0, 1))
        folder = playing.play_entry(twins, here / "runs", 1, Limits(start=300.0, answer=100.0), threads=1)
        playing.write_bundle(twins, folder, here / "twins.zip")
        playing.write_bundle(entry_of(here, (0,)), folder, here / "near.zip")
    return here


def entry_of(here: Path, seeds: tuple[int, ...]) -> submission_entry.Entry:
    """The entry of the agent in a folder that `play` made."""
    return submission_entry.Entry("near", f"{here}/near.py:Near", tiny_benchmark.NAME, seeds)


@contextmanager
def installed(here: Path) -> Iterator[None]:
    """Replaces the shipped benchmark by the tiny one in a folder that `play` made."""
    try:
        with pytest.MonkeyPatch.context() as patch:
            tiny_benchmark.install(here / "splits", patch.setattr)
            yield
    finally:
        tiny_benchmark.forget()


def taken_apart(file: Path, here: Path) -> Forgery:
    """Unpacks a bundle, so that a test can change it."""
    folder = here / "forged"
    with zipfile.ZipFile(file) as archive:
        archive.extractall(folder)
    return Forgery(folder, here / "board")


def row(number: int, **changes: Any) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """Changes one row of `test`."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        selected = (table["split"] == "test") & (table["row"] == number)
        for name, value in changes.items():
            table[name] = [value if is_row else old for is_row, old in zip(selected, table[name], strict=True)]
        return table

    return change
