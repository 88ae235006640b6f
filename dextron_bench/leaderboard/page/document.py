"""The page put together: one file with its style, script, tables and pictures, and nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Sequence
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import pandas as pd

from dextron_bench.leaderboard import highlights
from dextron_bench.leaderboard.page import sections, standings_table
from dextron_bench.leaderboard.page.html import Html, join, tag
from dextron_bench.leaderboard.page.rows import Entry, entries
from dextron_bench.leaderboard.page.sections import Curves, options
from dextron_bench.splits.loading import SPLIT_NAMES

FILE = "index.html"
FIRST = "real", "test"  # What is shown first, where there is a script.


def document(rows: pd.DataFrame, results: Iterable[dict[str, Any]], curves: Curves, recordings: Path) -> str:
    """The page's HTML, the same for the same results, from the leaderboard's `rows` and a folder of recordings.

    It asks for nothing: no network, no other file, and no script but its own may run. Raises BrokenRecording.
    """
    results, shown = list(results), highlights.chosen(recordings)
    found, script = entries(rows, results), _part("page.js")
    parts = {
        "Learning curves": sections.curves(curves, rows),
        "How episodes end": sections.endings(rows),
        "Who and from where": sections.heat(rows, results),
        "What the success model foresees": sections.ridges(recordings, shown),
        "Recordings": sections.recordings(shown),
    }
    filled = {
        "policy": _digest(script),
        "style": _part("page.css"),
        "script": script,
        "facts": _facts(rows),
        "controls": _controls(found),
        "table": standings_table.table(found, highlights.by_method(shown)),
        "sections": join(*(_section(title, list(content)) for title, content in parts.items())),
    }
    return Template(_part("page.html")).substitute(filled)


def _controls(found: Sequence[Entry]) -> Html:
    """What chooses rows: source, split and tier."""
    sources = sorted({each.reaches for each in found})
    names = [name for name in SPLIT_NAMES if name in {each.split for each in found}]
    tiers = sorted({each.tier for each in found})
    first = [value if value in known else None for value, known in zip(FIRST, (sources, names), strict=True)]
    choices = zip(("reaches", "split", "tier"), (sources, names, tiers), (*first, None), strict=True)
    return join(
        *(
            tag("label", name, tag("select", options(values, chosen, "all"), name=name))
            for name, values, chosen in choices
        )
    )


def _facts(rows: pd.DataFrame) -> Html:
    """How much there is, in a line."""
    told = {
        "methods": rows["method"].nunique(),
        "sources of reaches": rows["reaches"].nunique(),
        "rows": len(rows),
        "episodes": int(rows["episodes"].sum()),
    }
    return join(*(tag("li", tag("b", f"{count:,}"), f" {name}") for name, count in told.items()))


ABOUT = {
    "Learning curves": "Return on val while learning. Methods that do not learn in the world are lines at their return "
    "on test.",
    "How episodes end": "Each episode has one cause. The closing lag is how long after the expert's moment "
    "the hand closed; negative is too early.",
    "Who and from where": "Success in per cent, mean over seeds, by the person who reached and by where the hand "
    "started. Rings 0 to 3 go from near to far, angles 0 to 3 about the bottle from -x to -y; "
    "where there is a dash, no setting starts.",
    "What the success model foresees": "Each curve is the predicted chance of success of every action, later ones "
    "higher; the mark is the action taken. Green curves foretell the outcome, red ones do not.",
    "Recordings": "Episodes with all numbers exact. Served by dextron-bench leaderboard serve, a link opens in "
    "Rerun's web viewer; otherwise it is a file for dextron-bench view.",
}


def _section(title: str, content: Sequence[Html]) -> Html | None:
    if not content:
        return None
    name = title.lower().replace(" ", "-")
    nothing = tag("p", "Nothing here for this source and split.", class_="nothing", hidden="")
    heading = tag("h2", title, id=name)
    return tag("section", heading, tag("p", ABOUT[title]), *content, nothing, aria_labelledby=name)


def _digest(script: str) -> str:
    """What a content security policy calls a script by; it may be the page's only one."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _part(name: str) -> str:
    return files("dextron_bench.leaderboard.page").joinpath(name).read_text(encoding="utf-8")
