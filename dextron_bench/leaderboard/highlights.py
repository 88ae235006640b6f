"""A small choice of recordings that shows what there is: each method at its best and worst, and the success model."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd

from dextron_bench.evaluation.replay import replay
from dextron_bench.methods import registry as methods
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import from_frame
from dextron_bench.runs import rerecording as restoration
from dextron_bench.runs import selection as gallery
from dextron_bench.splits import loading as splits
from dextron_bench.storage import atomic
from dextron_bench.success import exemplars as explanation
from dextron_bench.success import network
from dextron_bench.success.exemplars import EXPERT, Foresight

EXPERTS = "exp"  # The method that plays experts.


def choose(runs: Path, reaches: Sequence[str], split: str, rows: int) -> pd.DataFrame:
    """The chosen ones of the first rows of a split that runs played, each with its `name`.

    Each method is shown on the first of the sources of reaches that it played, at its lowest seed. Raises
    NothingToView, DamagedFile, MissingData.
    """
    table = gallery.episodes([runs])
    table = table.assign(actions=table.get("actions"))  # Runs of earlier versions kept none.
    known = table[table["reaches"].isin(reaches) & (table["split"] == split) & (table["row"] < rows)]
    known = known[(known["length"] > 0) & known["actions"].notna()]
    order = known["reaches"].map(reaches.index)
    known = known[order == order.groupby(known["method"]).transform("min")]
    known = known[known["seed"] == known.groupby("method")["seed"].transform("min")]
    if known.empty:
        wanted = " or ".join(reaches)
        raise gallery.NothingToView(f"no run in {runs} played {split} of {wanted} reaches; `dextron-bench run` does")
    played = [name for name in reaches if (known["reaches"] == name).any()]
    cases = [case for name in played for case in _kinds(known[known["reaches"] == name], name, split)]
    return pd.concat([*_ends(known), *cases], ignore_index=True).drop_duplicates("name")


def make(chosen: pd.DataFrame, into: Path) -> list[Path]:
    """Copies the recordings of chosen episodes, made where they are missing, to `<name>.rrd` in a folder."""
    files = [into / f"{name}.rrd" for name in chosen["name"]]
    for file, recorded in zip(files, restoration.restore(chosen), strict=True):
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
        model = network.shipped(reaches)
    except network.MissingModel:
        return
    for kind, seen in explanation.choose(_foreseen(model, known, reaches, split)).items():
        method = EXPERTS if seen.player == EXPERT else seen.player
        own = known[known["method"] == method]
        mine = [setting == seen.episode.setting for setting in from_frame(own)]
        yield own[mine].head(1).assign(name=f"case-{kind}")


def _foreseen(model: network.SuccessModel, known: pd.DataFrame, reaches: str, split: str) -> Iterator[Foresight]:
    """All episodes of methods that are no floors, played again, as a model foretells them."""
    source, cases = sources.open_source(reaches), splits.load(reaches, split).cases
    kept = known[~known["method"].isin(methods.FLOORS)]
    for place, episode in sorted(replay(source, from_frame(kept), kept["actions"].tolist()), key=lambda each: each[0]):
        row = kept.iloc[place]
        player = EXPERT if row["method"] == EXPERTS else str(row["method"])
        yield explanation.foresee(model, source, cases[row["row"]], player, episode)
