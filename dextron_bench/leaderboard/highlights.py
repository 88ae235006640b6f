"""Selects recordings to show: a success and a failure of each method, and exemplars of the success model."""

from __future__ import annotations

import shutil
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import pandas as pd

from dextron_bench.catalogue import episodes, rerecording
from dextron_bench.evaluation.replay import replay
from dextron_bench.methods import registry
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import from_frame
from dextron_bench.recording import Recording, read_safely, summarise
from dextron_bench.splits.loading import Split, known_splits, load_split, ranking_splits
from dextron_bench.storage import atomic
from dextron_bench.storage.folders import visible
from dextron_bench.storage.run_folder import seed_folders
from dextron_bench.success import exemplars, network
from dextron_bench.success.exemplars import EXPERT, PredictedEpisode

FOLDER = "recordings"  # Next to the leaderboard's folder.
OUTCOMES = ("success", "failure")
EXEMPLAR = "case-"  # Prefix of the names of exemplars.
EXPERTS = "exp"  # The method that plays the expert of each setting.


@dataclass(frozen=True, slots=True)
class Shown:
    """A recording on the page: its file name, its kind (an outcome or an exemplar's), and its properties."""

    file: str
    kind: str
    method: str
    reaches: str
    split: str
    row: int
    score: float
    outcome: str

    @property
    def address(self) -> str:
        """Its link from a page in the leaderboard's folder."""
        return f"../{FOLDER}/{quote(self.file)}"


def choose(runs: Path, reaches: Sequence[str], split: str, rows: int, methods: Sequence[str] = ()) -> pd.DataFrame:
    """The episodes to show from the first rows of a split in a folder of runs, with a `name` for each.

    Each method, or each of `methods`, is shown on the first of the sources `reaches` that it played, at its lowest
    seed; exemplars are of any method. Raises NoEpisodes, DamagedFile, MissingData.
    """
    table = episodes.read([runs])
    table = table[table["reaches"].isin(reaches) & (table["split"] == split) & (table["row"] < rows)]
    table = episodes.with_actions(table[table["steps"] > 0])
    table = table[table["actions"].notna()]  # Runs of earlier versions did not keep actions.
    order = table["reaches"].map(reaches.index)
    table = table[order == order.groupby(table["method"]).transform("min")]
    table = table[table["seed"] == table.groupby("method")["seed"].transform("min")]
    if table.empty:
        raise episodes.NoEpisodes(
            f"no run in {runs} played {split} of {' or '.join(reaches)} reaches; `dextron-bench run` does"
        )
    by_source = {name: table[table["reaches"] == name] for name in reaches}
    cases = [case for name, group in by_source.items() if len(group) for case in _exemplars(group, name, split)]
    shown = table[table["method"].isin(methods)] if methods else table
    return pd.concat([*_shortest(shown), *cases], ignore_index=True).drop_duplicates("name")


def record_outcomes(run: Path, name: str, reaches: str, into: Path) -> list[Path]:
    """Records the shortest success and the shortest failure of a submission on its first split, at its lowest seed.

    `run` is the folder of its seeds, without recordings. Older recordings of its `name` are removed. Raises
    MissingData.
    """
    for outcome in OUTCOMES:
        (into / f"{name}-{outcome}.rrd").unlink(missing_ok=True)
    table = episodes.read([run])
    table = table[(table["split"] == ranking_splits(reaches)[0]) & (table["steps"] > 0)]
    table = table[table["seed"] == table["seed"].min()]
    files = make(pd.concat([*_shortest(table)]), into) if len(table) else []
    for seed in seed_folders(run):
        shutil.rmtree(seed.recordings, ignore_errors=True)
        seed.manifest.unlink(missing_ok=True)
    return files


def make(chosen: pd.DataFrame, into: Path) -> list[Path]:
    """Copies the recordings of chosen episodes to `<name>.rrd` in a folder; records those that are missing."""
    files = [into / f"{name}.rrd" for name in chosen["name"]]
    for file, recorded in zip(files, rerecording.rerecord(chosen), strict=True):
        atomic.write_atomically(file, lambda part, recorded=recorded: shutil.copyfile(recorded, part))
    return files


def published(folder: Path) -> list[Shown]:
    """The undamaged recordings in a folder whose names `recordings choose` gave, sorted by name."""
    shown = []
    for summary in summarise(visible(folder, "*.rrd")):
        kind = _kind(summary.file.stem)
        if kind and not summary.damage:
            properties = summary.properties
            method, reaches, split = (str(properties.get(name, "")) for name in ("method", "reaches", "split"))
            row, score = int(properties.get("row", 0)), float(properties["episode_return"])
            outcome = str(properties["outcome"])
            shown.append(Shown(summary.file.name, kind, method, reaches, split, row, score, outcome))
    return sorted(shown, key=lambda recording: recording.file)


def by_method(shown: Sequence[Shown]) -> dict[str, list[Shown]]:
    """The success and the failure of each method, in this order."""
    groups: dict[str, list[Shown]] = defaultdict(list)
    for kind in OUTCOMES:
        for recording in shown:
            if recording.kind == kind:
                groups[recording.method].append(recording)
    return groups


def ridges(folder: Path, shown: Sequence[Shown]) -> dict[str, PredictedEpisode]:
    """Predictions of the shipped success model for each exemplar, by its title, in the order of the paper's figure.

    Exemplars on another version of a split, or on a source without a model, are left out. Raises BrokenRecording.
    """
    files = {recording.kind: folder / recording.file for recording in shown}
    predictions = {kind: _predicted(files[kind]) for kind in exemplars.KINDS if kind in files}
    return {exemplars.KINDS[kind]: episode for kind, episode in predictions.items() if episode is not None}


def _shortest(table: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """The shortest success and the shortest failure of every method."""
    for method, rows in table.groupby("method"):
        for outcome in OUTCOMES:
            same_outcome = rows[rows["success"] == (outcome == "success")]
            yield same_outcome.sort_values("steps", kind="stable").head(1).assign(name=f"{method}-{outcome}")


def _exemplars(table: pd.DataFrame, reaches: str, split: str) -> Iterator[pd.DataFrame]:
    """The clearest episode of each of the five kinds of exemplars, if a success model ships for the source."""
    try:
        model = network.shipped_model(reaches)
    except network.MissingModel:
        return
    for kind, episode in exemplars.choose(_replayed(model, table, reaches, split)).items():
        method = EXPERTS if episode.player == EXPERT else episode.player
        rows = table[table["method"] == method]
        same_setting = [setting == episode.episode.setting for setting in from_frame(rows)]
        yield rows[same_setting].head(1).assign(name=f"{EXEMPLAR}{kind}")


def _replayed(model: network.SuccessModel, table: pd.DataFrame, reaches: str, split: str) -> Iterator[PredictedEpisode]:
    """Replays all episodes of methods that are not floors, with the model's predictions."""
    source, whole = sources.open_source(reaches), load_split(reaches, split)
    table = table[~table["method"].isin(registry.FLOORS)]
    replayed = dict(replay(source, whole.rows(table["row"]), table["actions"].tolist()))
    for position, row in enumerate(table.to_dict("records")):
        yield exemplars.predict_episode(
            model, source, whole.case(row["row"]), _player(row["method"]), replayed[position]
        )


def _predicted(file: Path) -> PredictedEpisode | None:
    """A recording with the model's predictions, None if its setting or its model is not available."""
    recorded = read_safely(file)
    reaches, name = str(recorded.properties.get("reaches")), str(recorded.properties.get("split"))
    if name not in known_splits(reaches):
        return None
    split = load_split(reaches, name)
    if split.digest != recorded.properties.get("split_digest") or reaches == "real":  # `real` needs an import.
        return None
    return _predict(recorded, split)


def _predict(recorded: Recording, split: Split) -> PredictedEpisode:
    model, source = network.shipped_model(split.reaches), sources.open_source(split.reaches)
    case = split.case(int(recorded.properties["row"]))
    return exemplars.predict_episode(model, source, case, _player(recorded.properties["method"]), recorded.episode)


def _player(method: object) -> str:
    return EXPERT if method == EXPERTS else str(method)


def _kind(stem: str) -> str | None:
    """The kind in a recording's name: an exemplar's, or the outcome of a method's episode; None for other names."""
    if stem.startswith(EXEMPLAR) and stem.removeprefix(EXEMPLAR) in exemplars.KINDS:
        return stem.removeprefix(EXEMPLAR)
    return next((outcome for outcome in OUTCOMES if stem.endswith(f"-{outcome}")), None)
