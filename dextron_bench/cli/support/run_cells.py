"""What tables and JSON say about a run, in `runs list`, `runs show` and `runs compare`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dextron_bench.catalogue.run_catalogue import Entry


INTERVALS = ("return", "success %")  # The scores that are shown with an interval.
SETTINGS = "settings."  # Begins the name of a column with a setting.


def cell(entry: Entry, name: str, split: str) -> Any:
    """The value of a column, as JSON has it; raises BadSearch."""
    values = {
        **{"run": entry.name, "state": entry.state, "seeds": len(entry.seeds), "note": entry.note},
        **{"val": _none_for_nan(entry.score("val")), "return": _none_for_nan(entry.score(split))},
        "success": _none_for_nan(entry.score(split, "success")),
        **{"date": _date(entry), "splits": list(entry.scores), "tags": list(entry.tags), "physics": entry.physics[:8]},
    }
    if name.startswith(SETTINGS):
        return entry.settings.get(name.removeprefix(SETTINGS))
    if name not in values:
        from dextron_bench.catalogue import run_search

        raise run_search.BadSearch(f"no column {name!r}; choose from {', '.join(values)} and {SETTINGS}NAME")
    return values[name]


def _none_for_nan(value: float) -> float | None:
    return None if math.isnan(value) else value


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


def code_of(entry: Entry) -> str:
    """The class of a run's method, and the first digits of the hash of its file if it is in a file."""
    return " ".join(filter(None, (entry.code.get("class"), (entry.code.get("sha256") or "")[:8])))


def plain(value: Any) -> str:
    """A value as text for a table or CSV; nothing for None."""
    if value is None:
        return ""
    return " ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
