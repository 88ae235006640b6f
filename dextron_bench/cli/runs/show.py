"""`dextron-bench runs list, show, best`: finds runs and shows what they have scored."""

from __future__ import annotations

import csv
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from dextron_bench.catalogue.run_search import RunFilter
from dextron_bench.cli.leaderboard.show import none_for_nan
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table

if TYPE_CHECKING:
    from dextron_bench.catalogue.run_catalogue import Entry

COLUMNS = ("run", "state", "seeds", "val", "return", "success", "date", "tags", "note")
INTERVALS = ("return", "success %")  # The scores that are shown with an interval.
SPLIT = "test"  # By default; a folder may have no scores on it yet.
SETTINGS = "settings."  # Begins the name of a column with a setting.


@dataclass(frozen=True)
class List:
    """List runs with their states and scores, a row for all seeds of a configuration.

    Example: dextron-bench runs list --method "rlil*" --sort return --split test
    """

    runs: Path = Path("runs")
    """Folder of all runs."""
    filter: Annotated[RunFilter, tyro.conf.arg(name="")] = field(default_factory=RunFilter)
    split: str = SPLIT
    """The split of the columns `return` and `success`."""
    sort: Literal["name", "date", "val", "return", "success"] = "name"
    """The order: by name, newest first, or highest score first: return on val, or return or success on the split."""
    columns: tuple[str, ...] = COLUMNS
    """The columns: some of run, state, seeds, val, return, success, date, tags, note, physics, settings.NAME."""
    json: bool = False
    """Print JSON."""
    csv: bool = False
    """Print comma-separated values."""

    def __call__(self) -> int:
        from dextron_bench.catalogue import run_catalogue, run_search

        known = run_catalogue.entries(self.runs)
        if self.split != SPLIT:
            run_search.check_split(known, self.split)
        entries = run_search.ordered(run_search.matching(known, self.filter, self.split), self.sort, self.split)
        rows = [{name: _cell(entry, name, self.split) for name in self.columns} for entry in entries]
        if self.json:
            print_json(rows)
        elif self.csv:
            writer = csv.writer(sys.stdout, lineterminator="\n")
            writer.writerows([self.columns, *([plain(row[name]) for name in self.columns] for row in rows)])
        else:
            cells = [[_shown(row[name], name) for name in self.columns] for row in rows]
            print_table(f"runs in {self.runs}, scores on {self.split}", self.columns, cells)
        return DONE


@dataclass(frozen=True)
class Show:
    """Show everything about a run: settings, code, state, and scores on every split.

    Example: dextron-bench runs show rlil-0.1/real
    """

    run: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run: its label, or its label and source of reaches, as in rlil-0.1/real."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    json: bool = False
    """Print JSON."""

    def __call__(self) -> int:
        from dextron_bench.catalogue import run_catalogue

        entry = run_catalogue.find(run_catalogue.entries(self.runs), self.run)
        about = {name: _cell(entry, name, "test") for name in ("run", "state", "date", "tags", "note", "physics")}
        about |= {"folder": str(entry.folder), "seeds": list(entry.seeds), "code": code_of(entry)}
        about |= {"settings": dict(entry.settings), "command": _command(entry)}
        splits = [
            {"split": name, "seeds": len(scores), "rows": scores.shape[1]}
            | {what: entry.score(name, what) for what in ("return", "success")}
            for name, scores in entry.scores.items()
        ]
        if self.json:
            print_json(about | {"splits": splits})
            return DONE
        about["settings"] = ", ".join(f"{name} {value}" for name, value in entry.settings.items())
        print_table(entry.name, ["", ""], [[name, plain(value)] for name, value in about.items() if name != "run"])
        rows = [
            [name, *scores.shape, *(interval_text(entry, name, what) for what in INTERVALS)]
            for name, scores in entry.scores.items()
        ]
        print_table("scores", ["split", "seeds", "rows", *(f"{what} [95 %]" for what in INTERVALS)], rows)
        return DONE


@dataclass(frozen=True)
class Best:
    """Print the run with the highest mean return on a split, by default `val`, which no ranking uses.

    Experts (`exp`) are left out: they are no entrant, and always best.

    Example: dextron-bench runs best --method "mine*" --split val
    """

    runs: Path = Path("runs")
    """Folder of all runs."""
    filter: Annotated[RunFilter, tyro.conf.arg(name="")] = field(default_factory=RunFilter)
    split: str = "val"
    """The split; on `val`, a run that has not played it counts with the best point of its learning curves."""
    json: bool = False
    """Print JSON."""

    def __call__(self) -> int:
        from dextron_bench.catalogue import run_catalogue, run_search
        from dextron_bench.methods.registry import CEILINGS

        entrants = [entry for entry in run_catalogue.entries(self.runs) if entry.label not in CEILINGS]
        entries = run_search.ordered(run_search.matching(entrants, self.filter, self.split), "return", self.split)
        if not entries or entries[0].score(self.split) != entries[0].score(self.split):
            raise run_search.BadSearch(f"none of the {len(entries)} runs has a score on {self.split!r}")
        best = entries[0]
        row = {"run": best.name, "return": best.score(self.split), "success": best.score(self.split, "success")}
        row |= {"seeds": len(best.seeds), "settings": dict(best.settings)}
        if self.json:
            print_json(row)
        else:
            print(f"{best.name}: return {row['return']:.2f}, success {100 * row['success']:.1f} % on {self.split}")
        return DONE


def _cell(entry: Entry, name: str, split: str) -> Any:
    """The value of a column, as JSON has it; raises BadSearch."""
    values = {
        **{"run": entry.name, "state": entry.state, "seeds": len(entry.seeds), "note": entry.note},
        **{"val": none_for_nan(entry.score("val")), "return": none_for_nan(entry.score(split))},
        "success": none_for_nan(entry.score(split, "success")),
        **{"date": _date(entry), "tags": list(entry.tags), "physics": entry.physics[:8]},
    }
    if name.startswith(SETTINGS):
        return entry.settings.get(name.removeprefix(SETTINGS))
    if name not in values:
        from dextron_bench.catalogue import run_search

        raise run_search.BadSearch(f"no column {name!r}; choose from {', '.join(values)} and {SETTINGS}NAME")
    return values[name]


def _date(entry: Entry) -> str | None:
    """When a run last ended or began; None if its files do not say."""
    return entry.changed.strftime("%Y-%m-%d %H:%M") if entry.changed else None


def interval_text(entry: Entry, split: str, what: str) -> str | None:
    """A run's mean score on a split with its 95 % interval, `what` being one of INTERVALS; None if it has no score."""
    from dextron_bench.scores import statistics
    from dextron_bench.world import task

    if (scores := entry.scores.get(split)) is None:
        return None
    if what == "return":
        score = statistics.estimate(scores)
        return f"{score.mean:.2f} [{score.low:.2f}, {score.high:.2f}]"
    share = statistics.estimate((scores == task.SUCCESS).astype(float), statistics.SHARES)
    return f"{100 * share.mean:.1f} [{100 * share.low:.1f}, {100 * share.high:.1f}]"


def _command(entry: Entry) -> str:
    """The command that makes a run again, as far as its config says."""
    from dextron_bench.methods import registry

    settings = {name: value for name, value in entry.settings.items() if value is not None}
    try:
        flags = registry.as_flags(str(entry.code.get("class", entry.label)), settings)
    except registry.UnknownMethod:  # Its file lies elsewhere.
        words = [f"--method {entry.code.get('class')}", *(registry.as_flag(*one) for one in settings.items())]
        flags = " ".join(words)
    return f"dextron-bench run {flags} --reaches {entry.reaches} --seed {' '.join(map(str, entry.seeds))}"


def code_of(entry: Entry) -> str:
    """The class of a run's method, and the first digits of the hash of its file if it is in a file."""
    return " ".join(filter(None, (entry.code.get("class"), (entry.code.get("sha256") or "")[:8])))


def plain(value: Any) -> str:
    """A value as text for a table or CSV; nothing for None."""
    if value is None:
        return ""
    return " ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)


def _shown(value: Any, name: str) -> str:
    """A value as a person reads it: scores rounded, success as a percentage."""
    if name == "success" and value is not None:
        return f"{100 * value:.1f} %"
    return f"{value:.2f}" if isinstance(value, float) else plain(value)
