"""Turns what pytest-benchmark wrote into the table of docs/benchmarks.md: `table.py IN.json OUT.md`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

HEAD = """# Benchmarks

{machine}

`make bench` measures this and writes this file. Two ways of doing a thing take turns in one process, and the medians
are compared, so that ratios hold where the rates of a busy machine do not. The bare physics of the first rows gets
the same states, controls and carrier poses as the episodes got, and nothing is read back. Paths are made beforehand
there; their price is told apart.

| what | rate | held against | its rate | ratio |
| --- | ---: | --- | ---: | ---: |
"""


def page(found: dict[str, Any]) -> str:
    """The whole file, from the content of pytest-benchmark's JSON."""
    rows = [row for each in found["benchmarks"] for row in each["extra_info"].get("rows", ())]
    scales = {each["extra_info"].get("scale", 1.0) for each in found["benchmarks"]}
    note = "" if scales == {1.0} else "\nThe amounts of work were cut down: these numbers only show that all runs.\n"
    return HEAD.format(machine=machine(found)) + "".join(map(line, rows)) + note


def machine(found: dict[str, Any]) -> str:
    """Processor, system, versions and day, in a sentence."""
    info, commit = found["machine_info"], found["commit_info"]
    cpu = info.get("cpu", {})
    name = cpu.get("brand_raw") or info.get("processor") or info.get("machine")
    dirty = ", changed since" if commit.get("dirty") else ""
    return (
        f"{name}, {cpu.get('count', '?')} cores, {info['system']}; {info['python_implementation']} "
        f"{info['python_version']}; commit {str(commit.get('id'))[:10]}{dirty}; {found['datetime'][:10]}."
    )


def line(row: dict[str, Any]) -> str:
    """A line of the table."""
    ratio, its = "", ""
    if row["against_rate"] is not None:
        ratio = f"{row['rate'] / row['against_rate']:.3g}"
        ratio += f" (aim {row['aim']:g})" if row["aim"] is not None else ""
        its = f"{number(row['against_rate'])} {row['unit']}"
    return f"| {row['what']} | {number(row['rate'])} {row['unit']} | {row['against']} | {its} | {ratio} |\n"


def number(value: float) -> str:
    """Three digits that count."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def main(words: Iterable[str]) -> None:
    """Reads the first file and writes the second."""
    read, written = map(Path, words)
    written.write_text(page(json.loads(read.read_text(encoding="utf-8"))), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
