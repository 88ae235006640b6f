"""`dextron-bench data fit` and `data likeness`: the model behind synthetic reaches, and how like they are."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.output import print_json, print_table, progress_bar

if TYPE_CHECKING:
    import pandas as pd


class BadSeed(ValueError):
    """A seed below zero."""

    def __init__(self, seed: int) -> None:
        super().__init__(f"a seed is 0 or more, not {seed}")


@dataclass(frozen=True)
class Fit:
    """Fit the model of synthetic reaches to the recorded ones again, and say how far it is from the shipped one.

    Example: dextron-bench data fit --into synthetic-reaches.npz
    """

    seed: int = 0
    """Seed of the fit; the shipped model has 0."""
    into: Annotated[Path, tyro.conf.arg(metavar="FILE.npz")] = Path("synthetic-reaches.npz")
    """File to write the parameters to."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from importlib.resources import files

        from dextron_bench.reaches.recorded import cache
        from dextron_bench.reaches.synthetic import fitting
        from dextron_bench.storage import atomic

        if self.seed < 0:
            raise BadSeed(self.seed)
        shipped = files("dextron_bench").joinpath("data/synthetic-reaches.npz").read_bytes()
        with progress_bar("models fitted", self.quiet) as progress, TemporaryDirectory() as folder:
            model = fitting.fit(cache.load_reaches(), self.seed)
            progress(1, 1)
            made = Path(folder) / "model.npz"
            fitting.save(model, made)
            content = made.read_bytes()
        into = self.into.expanduser()
        atomic.write_atomically(into, lambda part: part.write_bytes(content))
        print(f"{into}: {len(content):,} bytes, {compared(content, shipped)}")
        return 0


def compared(made: bytes, shipped: bytes) -> str:
    """What a file of parameters has in common with the shipped one, in words."""
    import numpy as np

    if made == shipped:
        return "byte for byte the shipped file"
    with np.load(io.BytesIO(made)) as new, np.load(io.BytesIO(shipped)) as old:
        pairs = {name: (new[name].astype(float), old[name].astype(float)) for name in old.files}
    if other := [name for name, (a, b) in pairs.items() if a.shape != b.shape]:
        return f"not the shipped file: {', '.join(other)} differ in shape"
    total = sum(a.size for a, _ in pairs.values())
    differ = sum(int((a != b).sum()) for a, b in pairs.values())
    if not differ:
        return "every number as in the shipped file, but packed into other bytes"
    far = {name: float(abs(a - b).max() / abs(b).max()) for name, (a, b) in pairs.items()}
    worst = max(far, key=far.__getitem__)
    return (
        f"not the shipped file: {differ:,} of {total:,} numbers differ, by at most {far[worst]:.1g} of the largest "
        f"in their array ({worst})"
    )


@dataclass(frozen=True)
class Likeness:
    """Ask classifiers to tell synthetic reaches from recorded ones: AUC, where 0.5 is guessing. Takes minutes.

    Example: dextron-bench data likeness --json
    """

    seed: int = 0
    """Seed of folds, fits, forests and intervals."""
    json: bool = False
    """Print JSON: lists of rows by table, with every start region of every classifier."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.reaches.recorded import cache
        from dextron_bench.reaches.synthetic import two_sample

        if self.seed < 0:
            raise BadSeed(self.seed)
        with progress_bar("models and classifiers", self.quiet) as progress:
            tables = two_sample.study(cache.load_reaches(), self.seed, progress)
        if self.json:
            print_json({name: table.to_dict("records") for name, table in tables.items()})
        else:
            print_likeness(tables)
        return 0


def print_likeness(tables: dict[str, pd.DataFrame]) -> None:
    """The tables of `likeness.study` on stdout."""
    held_out, strangers = with_interval(tables["held out"]), with_interval(tables["strangers"])
    whole = held_out[held_out["stratum"] == "all"]
    print_pivot("AUC [95 %], by models without the reaches judged", whole, "group", "classifier")
    for group, found in held_out[held_out["classifier"] == "forest"].groupby("group", sort=False):
        print_places(f"AUC ± half of 95 % interval, forest, {group}", found)
    for classifier, found in strangers.groupby("classifier", sort=False):
        print_pivot(f"AUC for strangers, mean and range of splits, {classifier}", found, "group", "beside")
    print_rows("least and greatest AUC of a single feature", tables["alone"])
    distances = tables["nearest"].set_index("source") * 1000.0
    print_rows("mm to the nearest other recording, quantiles", distances.reset_index())
    names = tables["distributions"]["measure"].str.replace("[", "in ").str.rstrip("]")
    print_rows("quantiles", tables["distributions"].assign(measure=names))


def with_interval(table: pd.DataFrame) -> pd.DataFrame:
    """A table of AUCs with a column `cell` of text: the AUC and its bounds."""
    cells = [f"{row.auc:.2f} [{row.low:.2f}, {row.high:.2f}]" for row in table.itertuples()]
    return table.assign(cell=cells)


def print_places(title: str, table: pd.DataFrame) -> None:
    """AUCs of one group and classifier on stdout: rings down, angles across, and all of either."""
    places = {
        row["stratum"]: f"{row['auc']:.2f} ±{(row['high'] - row['low']) / 2:.2f}" for row in table.to_dict("records")
    }
    rings, angles = ([name for name in places if name.startswith(kind)] for kind in ("ring", "angle"))
    rows = [[ring, *(places.get(f"{ring[-1]}-{angle[-1]}", "") for angle in angles), places[ring]] for ring in rings]
    print_table(title, ["", *angles, "all"], [*rows, ["all", *(places[angle] for angle in angles), places["all"]]])


def print_pivot(title: str, table: pd.DataFrame, rows: str, columns: str) -> None:
    """Cells of a table on stdout, one row and one column for each of their values in two columns."""
    wide = table.set_index([rows, columns])["cell"].unstack(sort=False)
    print_table(title, [rows, *wide.columns], wide.reset_index().to_numpy().tolist())


def print_rows(title: str, table: pd.DataFrame) -> None:
    """A table on stdout as it is."""
    print_table(title, [str(column) for column in table.columns], table.itertuples(index=False))
