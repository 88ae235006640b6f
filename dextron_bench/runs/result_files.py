"""`result.json`: written from the table of episodes, read with checks, found by label or path."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import pandas as pd
from msgspec.structs import replace

from dextron_bench.errors import NotFound
from dextron_bench.evaluation.results import Maker, Result, scores_by_split
from dextron_bench.methods.registry import NAME
from dextron_bench.storage import atomic, records, run_times
from dextron_bench.storage.folders import visible
from dextron_bench.storage.provenance import Provenance
from dextron_bench.storage.run_folder import RunFolder, run_folders, seed_folders

Results = Sequence[Result]


def write_result(folder: RunFolder, table: pd.DataFrame, about: dict[str, Any], seconds: float | None = None) -> None:
    """Writes the result of a run: the score of every episode, how episodes end, and what made them; notes its end.

    A result that does not change leaves the end as it was. `seconds` of training belong to the provenance, since they
    differ each time.
    """
    maker = records.read(folder.config, Maker)
    made_by = records.read(folder.provenance, Provenance)
    made_by = made_by if seconds is None else replace(made_by, seconds=seconds)
    result = Result(**about, splits=scores_by_split(table), provenance=made_by, maker=maker)
    before = folder.result.read_bytes() if folder.result.exists() else b""
    atomic.write_json(folder.result, result)
    if folder.result.read_bytes() != before:
        run_times.note_end(folder)


def results(runs: Path) -> Iterator[Result]:
    """Every result below a folder of runs; raises DamagedFile."""
    return (read_result(run.result) for run in finished(runs))


def finished(runs: Path, label: str = "*") -> list[RunFolder]:
    """The run folders below a folder of runs that hold a result, sorted."""
    return [run for run in run_folders(runs, label) if run.result.exists()]


def read_result(file: Path) -> Result:
    """The content of a `result.json`; raises DamagedFile."""
    return records.read(file, Result)


def published_results() -> Path:
    """The folder of published results: package data, or `leaderboard/results` in a checkout."""
    package = Path(str(files("dextron_bench")))
    shipped = package / "data" / "results"
    return shipped if shipped.is_dir() else package.parent / "leaderboard" / "results"


def published_beside(new: Results) -> list[Result]:
    """The published results of other methods than these, on the splits and the physics that these results have too."""
    methods = {result.method for result in new}
    physics = {result.physics for result in new} - {""}
    digests = {split.digest for result in new for split in result.splits.values()}
    return [
        replace(result, splits={name: split for name, split in result.splits.items() if split.digest in digests})
        for result in results(published_results())
        if result.method not in methods and result.physics in physics
    ]


def find(name: str, runs: Path, split: str = "") -> Results:
    """The results of one method by its label in `runs` and, for sources that it has not played there, as published.

    With a split, a source counts as played if a run there has played that split. If neither place has any result, the
    name is a path: a `result.json`, a run's folder, or the folder of a method's runs.
    Raises NotFound, DamagedFile.
    """
    results = [read_result(file) for file in _files(name, runs, split)]
    if not results:
        raise NotFound(
            f"no result of {name!r}: {runs} has {_labels(runs)}, and published results are "
            f"{_labels(published_results())}; give one of them, or the path of a run"
        )
    if len(labels := {result.method for result in results}) > 1:
        raise NotFound(f"{name!r} holds results of {_listed(labels)}; give one of them")
    return results


def _files(name: str, runs: Path, split: str) -> list[Path]:
    """The files of a method's results."""
    if NAME.fullmatch(name):
        mine, published = finished(runs, name), finished(published_results(), name)
        played = {_source(run) for run in mine if not split or split in read_result(run.result).splits}
        instead = [run for run in published if _source(run) not in played]
        replaced = {_source(run) for run in instead}
        if mine or instead:
            return [run.result for run in [*(run for run in mine if _source(run) not in replaced), *instead]]
    path = Path(name)
    if path.is_file():
        return [path]
    depths = (
        [RunFolder(path)],
        seed_folders(path),
        [run for place in visible(path, "*") for run in seed_folders(place)],
    )
    return next(filter(None, ([run.result for run in depth if run.result.exists()] for depth in depths)), [])


def _source(run: RunFolder) -> str:
    """The source of reaches that a run's folder is named after."""
    return run.path.parent.name


def _labels(runs: Path) -> str:
    return _listed({run.label for run in finished(runs)}) or "none"


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))
