"""Searches the catalogue of runs: filters, orders and picks the best."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

    from dextron_bench.catalogue.run_catalogue import Entry

SCORES = ("return", "success")
VAL = "val"  # Orders by the mean return on the split of this name, whatever the split is.
ORDERS = ("name", "date", VAL, *SCORES)
STATES = ("done", "training", "playing", "stopped", "unfinished", "failed")  # The first words of states.


class BadSearch(ValueError):
    """A filter that no run could pass, or an order that does not exist."""


@dataclass(frozen=True, slots=True)
class RunFilter:
    """Which runs; an option that is not given selects all. Raises BadSearch."""

    method: str = ""
    """A pattern of labels, such as "rlil*"."""
    reaches: str = ""
    """The source of reaches."""
    setting: tuple[str, ...] = ()
    """Settings with their values, such as near=0.06."""
    tag: tuple[str, ...] = ()
    """Tags that a run must have."""
    since: str = ""
    """A date, such as 2026-01-31: only runs that ended, or began, since."""
    state: str = ""
    """The beginning of a state: done, training, playing, stopped, unfinished, failed."""
    where: str = ""
    """An expression, such as "val > 15 and near < 0.1"; docs/runs.md lists the columns."""

    def __post_init__(self) -> None:
        for text in self.setting:
            if "=" not in text:
                raise BadSearch(f"--setting {text!r}: write a name and a value, as in near=0.06")
        if self.since:
            _date(self.since)
        if not any(known.startswith(self.state) or self.state.startswith(known) for known in STATES):
            raise BadSearch(f"--state {self.state!r}: choose from {', '.join(STATES)}")

    def passes(self, entry: Entry) -> bool:
        """True for a run that the filter selects."""
        wanted = [text.partition("=") for text in self.setting]
        return (
            (not self.method or fnmatchcase(entry.label, self.method))
            and self.reaches in ("", entry.reaches)
            and all(name in entry.settings and _equal(entry.settings[name], value) for name, _, value in wanted)
            and set(self.tag) <= set(entry.tags)
            and (not self.since or (entry.changed is not None and entry.changed >= _date(self.since)))
            and entry.state.startswith(self.state)
        )


def matching(entries: Iterable[Entry], run_filter: RunFilter, split: str) -> list[Entry]:
    """The entries that a filter selects; `split` is the split of the scores. Raises BadExpression."""
    from dextron_bench.catalogue import expressions  # Loads pandas, which the flags of commands do not need.

    passing = [entry for entry in entries if run_filter.passes(entry)]
    table = _table(passing, split)
    return [passing[place] for place in expressions.filtered(table, run_filter.where, map(str, table)).index]


def ordered(entries: Iterable[Entry], order: str, split: str) -> list[Entry]:
    """Entries by name, with the newest first by "date", with the highest score on a split first by "return", "success".

    By "val" the highest mean return on `val` comes first. Entries without the score come last. Raises BadSearch.
    """
    if order not in ORDERS:
        raise BadSearch(f"--sort {order!r}: choose from {', '.join(ORDERS)}")
    known = sorted(entries, key=lambda entry: (entry.label, entry.reaches))
    table = _table(known, split)
    return [known[place] for place in table.sort_values(order, ascending=order == "name", kind="stable").index]


def check_split(entries: Sequence[Entry], split: str) -> None:
    """Raises BadSearch if runs have played splits, but no run the given one."""
    played = dict.fromkeys(name for entry in entries for name in entry.scores)
    if played and split not in {VAL, *played}:
        raise BadSearch(f"no run has played {split!r}; there are {', '.join(played)}")


def differing_settings(entries: Sequence[Entry]) -> list[str]:
    """Names of the settings in which entries differ, with "code" and "physics" if these do."""
    names = list(dict.fromkeys(name for entry in entries for name in entry.settings))
    differing = [name for name in names if len({repr(entry.settings.get(name)) for entry in entries}) > 1]
    others = {"code": [entry.code for entry in entries], "physics": [entry.physics for entry in entries]}
    return differing + [name for name, values in others.items() if len(set(map(repr, values))) > 1]


def _table(entries: Sequence[Entry], split: str) -> pd.DataFrame:
    """A row for each entry: what `runs list` shows of it, and its settings; the index is its place."""
    import pandas as pd

    rows = [
        {
            **{"name": entry.label, "reaches": entry.reaches, "state": entry.state, "seeds": len(entry.seeds)},
            **{VAL: entry.score(VAL), **{what: entry.score(split, what) for what in SCORES}},
            **{"date": entry.changed.astimezone(UTC).isoformat() if entry.changed else ""},
            **{"tags": " ".join(entry.tags), "note": entry.note, "physics": entry.physics},
        }
        for entry in entries
    ]
    columns = ("name", "reaches", "state", "seeds", VAL, *SCORES, "date", "tags", "note", "physics")
    settings = dict.fromkeys(name for entry in entries for name in entry.settings if name not in columns)
    values = {name: _of_one_kind([entry.settings.get(name) for entry in entries]) for name in settings}
    return pd.DataFrame(rows, columns=columns).assign(**values)


def _of_one_kind(values: Sequence[Any]) -> list[Any]:
    """The values of a setting as True and False, as numbers (NaN if missing), or as texts (empty if missing)."""
    known = [value for value in values if value is not None]
    if len(known) == len(values) and all(isinstance(value, bool) for value in known):
        return list(values)
    if known and all(isinstance(value, int | float) and not isinstance(value, bool) for value in known):
        return [float("nan") if value is None else float(value) for value in values]
    return ["" if value is None else str(value) for value in values]


def _equal(value: object, text: str) -> bool:
    """True if a setting has the value that a text gives; numbers are compared as numbers."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            return float(text) == value
        except ValueError:
            return False
    return str(value) == text


def _date(text: str) -> datetime:
    try:
        return datetime.combine(date.fromisoformat(text), datetime.min.time(), UTC)
    except ValueError:
        raise BadSearch(f"--since {text!r}: write a date such as 2026-01-31") from None
