"""Assembles the page: one file with its style, script, tables and pictures, and no link to another host."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Sequence
from importlib.resources import files
from pathlib import Path
from string import Template

import pandas as pd

from dextron_bench.evaluation.results import Result
from dextron_bench.leaderboard import highlights
from dextron_bench.leaderboard.page import sections, standings_table
from dextron_bench.leaderboard.page.rows import PageRow, entries
from dextron_bench.leaderboard.page.sections import Curves
from dextron_bench.leaderboard.page.standings_table import Code
from dextron_bench.splits.names import SPLIT_NAMES
from dextron_bench.splits.tracks import PLUS
from dextron_bench.web.html import Html, join, style, tag
from dextron_bench.world import model

FILE = "index.html"
SELECTED = {"reaches": "real", "split": "test"}  # The page starts with these rows if scripts may run.
DESCRIPTIONS = {
    "Ranks": "From settings that were drawn after all entries were fixed, the same for all. The score is the mean "
    "success on new reaches, new people and hard settings. Beside it stand the paper's protocol, and how much more each"
    " seed solves of its public version. A rank is 1 and the number of methods whose score is higher by more than the "
    "margin. On real reaches, the reaches themselves are public, and the new people are two.",
    "Learning curves": "Return on val during training. Methods that do not train in the simulated world are horizontal "
    "lines at their return on test.",
    "How episodes end": "Each episode has one cause. The closing lag is the time from the expert's closing to the "
    "method's; a negative lag means that the hand closed too early.",
    "Success by subject and start region": "Success in per cent, mean over seeds, by the subject and by the "
    "start of the hand. Rings 0 to 3 go from near to far, angles 0 to 3 go around the bottle from -x to -y. "
    "A dash means that no setting starts there.",
    "Tracks": "The mean return of 20 under conditions that a real prosthesis adds: actions that arrive late, errors of "
    "the sensors, and bottles of other mass, friction and radius. The area is the mean over delays from 0 to 300 ms, "
    "where 1 is a success every time. Tracks play no part in the ranks.",
    "Predictions of the success model": "Each curve is the predicted chance of success of every action; later steps "
    "are higher up. The mark is the action that was taken. Green curves predict the outcome correctly, red ones do "
    "not.",
    "Recordings": "Each recording holds all numbers of an episode exactly. If dextron-bench leaderboard serve "
    "shows this page, a link opens Rerun's web viewer; otherwise it leads to a file for dextron-bench view.",
}


def document(
    rows: pd.DataFrame, ranked: pd.DataFrame, results: Iterable[Result], curves: Curves, recordings: Path, code: Code
) -> str:
    """The page's HTML from the leaderboard's `rows` and a folder of recordings; equal results give equal bytes.

    `ranked` is the table of the latest round (`round_table.table`).

    `code` holds the paths from the page to the files of submitted agents, by method and source of reaches. The page
    makes no request, and its content security policy allows only its own script. Raises BrokenRecording.
    """
    results, shown = list(results), highlights.published(recordings)
    table_entries, script = entries(rows, results), _resource("page.js")
    contents = {
        "Learning curves": sections.curves(curves, rows),
        "How episodes end": sections.endings(rows),
        "Success by subject and start region": sections.heatmaps(rows, results),
        "Tracks": sections.tracks(results),
        "Predictions of the success model": sections.ridges(recordings, shown),
        "Recordings": sections.recordings(shown),
    }
    values = {
        "policy": _script_hash(script),
        "style": style(),
        "script": script,
        "facts": _facts(rows),
        "ranks": _section("Ranks", list(sections.ranks(ranked))) or Html(""),
        "controls": _controls(table_entries),
        "table": standings_table.table(table_entries, highlights.by_method(shown), code),
        "sections": join(*(_section(title, list(content)) for title, content in contents.items())),
    }
    return Template(_resource("page.html")).substitute(values)


def _controls(table_entries: Sequence[PageRow]) -> Html:
    """The controls that filter the table by source, split and tier."""
    splits = {entry.split for entry in table_entries}
    choices = {
        "reaches": sorted({entry.reaches for entry in table_entries}),
        "split": sorted(splits, key=lambda name: ([*SPLIT_NAMES, name].index(name.partition(PLUS)[0]), name)),
        "tier": sorted({entry.tier for entry in table_entries}),
    }
    return join(
        *(
            tag("label", name, tag("select", _options(values, SELECTED.get(name)), name=name))
            for name, values in choices.items()
        )
    )


def _options(values: Sequence[str], selected: str | None) -> Html:
    """The options of a control; the first is "all"."""
    rest = (tag("option", value, selected="" if value == selected else None) for value in values)
    return join(tag("option", "all", value=""), *rest)


def _facts(rows: pd.DataFrame) -> Html:
    """How many methods, sources, rows and episodes the leaderboard has, and the physics of all of them."""
    counts = {
        "methods": rows["method"].nunique(),
        "sources of reaches": rows["reaches"].nunique(),
        "rows": len(rows),
        "episodes": int(rows["episodes"].sum()),
    }
    physics = tag("li", "physics ", tag("b", model.mjcf_hash()[:8]))
    return join(*(tag("li", tag("b", f"{count:,}"), f" {name}") for name, count in counts.items()), physics)


def _section(title: str, content: Sequence[Html]) -> Html | None:
    if not content:
        return None
    name = title.lower().replace(" ", "-")
    nothing = tag("p", "No data for this source and split.", class_="nothing", hidden="")
    heading = tag("h2", title, id=name)
    return tag("section", heading, tag("p", DESCRIPTIONS[title]), *content, nothing, aria_labelledby=name)


def _script_hash(script: str) -> str:
    """The script's hash for the content security policy."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _resource(name: str) -> str:
    return files("dextron_bench.leaderboard.page").joinpath(name).read_text(encoding="utf-8")
