"""A small choice of recordings that shows what there is: each method at its best and worst, and the success model."""

from __future__ import annotations

import shutil
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import pandas as pd

from dextron_bench.evaluation.replay import replay
from dextron_bench.methods import registry
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import from_frame
from dextron_bench.recording import Recording, read_safely, summarise
from dextron_bench.runs import rerecording, selection
from dextron_bench.splits.loading import Split, known_splits, load_split
from dextron_bench.storage import atomic
from dextron_bench.success import exemplars, network
from dextron_bench.success.exemplars import EXPERT, PredictedEpisode

EXPERTS = "exp"  # The method that plays experts.


def choose(runs: Path, reaches: Sequence[str], split: str, rows: int) -> pd.DataFrame:
    """The chosen ones of the first rows of a split that runs played, each with its `name`.

    Each method is shown on the first of the sources of reaches that it played, at its lowest seed. Raises
    NoEpisodes, DamagedFile, MissingData.
    """
    table = selection.episodes([runs])
    table = table.assign(actions=table.get("actions"))  # Runs of earlier versions kept none.
    known = table[table["reaches"].isin(reaches) & (table["split"] == split) & (table["row"] < rows)]
    known = known[(known["length"] > 0) & known["actions"].notna()]
    order = known["reaches"].map(reaches.index)
    known = known[order == order.groupby(known["method"]).transform("min")]
    known = known[known["seed"] == known.groupby("method")["seed"].transform("min")]
    if known.empty:
        wanted = " or ".join(reaches)
        raise selection.NoEpisodes(f"no run in {runs} played {split} of {wanted} reaches; `dextron-bench run` does")
    played = [name for name in reaches if (known["reaches"] == name).any()]
    cases = [case for name in played for case in _kinds(known[known["reaches"] == name], name, split)]
    return pd.concat([*_ends(known), *cases], ignore_index=True).drop_duplicates("name")


def make(chosen: pd.DataFrame, into: Path) -> list[Path]:
    """Copies the recordings of chosen episodes, made where they are missing, to `<name>.rrd` in a folder."""
    files = [into / f"{name}.rrd" for name in chosen["name"]]
    for file, recorded in zip(files, rerecording.rerecord(chosen), strict=True):
        atomic.write_atomically(file, lambda part, recorded=recorded: shutil.copyfile(recorded, part))
    return files


def _ends(known: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """The shortest success and the shortest failure of every method."""
    for method, own in known.groupby("method"):
        for success, word in ((True, "success"), (False, "failure")):
            found = own[own["success"] == success].sort_values("length", kind="stable").head(1)
            yield found.assign(name=f"{method}-{word}")


def _kinds(known: pd.DataFrame, reaches: str, split: str) -> Iterator[pd.DataFrame]:
    """The clearest episode of each of the five kinds that explain the success model, where one ships."""
    try:
        model = network.shipped_model(reaches)
    except network.MissingModel:
        return
    for kind, seen in exemplars.choose(_foreseen(model, known, reaches, split)).items():
        method = EXPERTS if seen.player == EXPERT else seen.player
        own = known[known["method"] == method]
        mine = [setting == seen.episode.setting for setting in from_frame(own)]
        yield own[mine].head(1).assign(name=f"case-{kind}")


def _foreseen(model: network.SuccessModel, known: pd.DataFrame, reaches: str, split: str) -> Iterator[PredictedEpisode]:
    """All episodes of methods that are no floors, played again, as a model foretells them."""
    source, cases = sources.open_source(reaches), load_split(reaches, split).cases
    kept = known[~known["method"].isin(registry.FLOORS)]
    for place, episode in sorted(replay(source, from_frame(kept), kept["actions"].tolist()), key=lambda each: each[0]):
        row = kept.iloc[place]
        player = EXPERT if row["method"] == EXPERTS else str(row["method"])
        yield exemplars.predict_episode(model, source, cases[row["row"]], player, episode)


FOLDER = "recordings"  # Beside the leaderboard's.


KINDS = ("success", "failure")


CASE = "case-"


@dataclass(frozen=True, slots=True)
class Shown:
    """A chosen recording: its file's name, which kind it is of, and what it says of itself."""

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
        """Where it lies for a page in the leaderboard's folder."""
        return f"../{FOLDER}/{quote(self.file)}"


def chosen(folder: Path) -> list[Shown]:
    """The recordings in a folder that are whole and called as `recordings choose` does, sorted by name."""
    found = []
    for each in summarise(sorted(folder.glob("*.rrd"))):
        kind = _kind(each.file.stem)
        if kind and not each.damage:
            told = each.properties
            method, reaches, split = (str(told.get(name, "")) for name in ("method", "reaches", "split"))
            row, score = int(told.get("row", 0)), float(told["episode_return"])
            found.append(Shown(each.file.name, kind, method, reaches, split, row, score, str(told["outcome"])))
    return sorted(found, key=lambda each: each.file)


def by_method(shown: list[Shown]) -> dict[str, list[Shown]]:
    """The successes and failures of each method, successes first."""
    found: dict[str, list[Shown]] = defaultdict(list)
    for each in sorted(shown, key=lambda each: KINDS.index(each.kind) if each.kind in KINDS else len(KINDS)):
        if each.kind in KINDS:
            found[each.method].append(each)
    return found


def ridges(folder: Path, shown: list[Shown]) -> dict[str, PredictedEpisode]:
    """What the success model that ships thinks of each case, by its kind in words, in the order of the paper's figure.

    Cases of a split's other version, or of a source without a model, are left out. Raises BrokenRecording.
    """
    cases = {each.kind: each for each in shown if each.kind in exemplars.KINDS}
    found = ((kind, cases[kind]) for kind in exemplars.KINDS if kind in cases)
    return {exemplars.KINDS[kind]: seen for kind, each in found for seen in _foresight(folder / each.file)}


def _foresight(file: Path) -> Iterator[PredictedEpisode]:
    """The recording as the model foretells it, nothing where that cannot be."""
    recorded = read_safely(file)
    told = recorded.properties
    reaches, name = str(told.get("reaches")), str(told.get("split"))
    if name not in known_splits(reaches):
        return
    split = load_split(reaches, name)
    if split.digest == told.get("split_digest") and reaches != "real":  # Recorded reaches may not be here.
        yield _foresee(recorded, split)


def _foresee(recorded: Recording, split: Split) -> PredictedEpisode:
    model, source = network.shipped_model(split.reaches), sources.open_source(split.reaches)
    case = split.case(int(recorded.properties["row"]))
    method = str(recorded.properties["method"])
    return exemplars.predict_episode(model, source, case, EXPERT if method == "exp" else method, recorded.episode)


def _kind(stem: str) -> str | None:
    """`success` or `failure` of a method, or one of the explanation's KINDS."""
    if stem.startswith(CASE) and stem.removeprefix(CASE) in exemplars.KINDS:
        return stem.removeprefix(CASE)
    return next((kind for kind in KINDS if stem.endswith(f"-{kind}")), None)
