"""Writes docs/benchmarks.md from the JSON file of pytest-benchmark: `table.py IN.json OUT.md`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

HEAD = """# Benchmarks

{machine}

`make bench` runs these measurements and writes this file. Two ways of doing the same thing take turns in one process,
and we compare their medians. The ratios therefore hold even if other load on the machine changes the rates. In the
first rows, the bare physics gets the same states, controls and carrier poses as the episodes, and nothing is read back.
There, paths are made beforehand, and their cost is listed separately. How long the tests take is in
[CONTRIBUTING.md](../CONTRIBUTING.md).

| what | rate | compared with | its rate | ratio |
| --- | ---: | --- | ---: | ---: |
"""


def page(report: dict[str, Any]) -> str:
    """The content of docs/benchmarks.md, from the content of pytest-benchmark's JSON."""
    infos = [benchmark["extra_info"] for benchmark in report["benchmarks"]]
    rows = [row for info in infos for row in info.get("rows", ())]
    scales = {info.get("scale", 1.0) for info in infos}
    note = (
        "" if scales == {1.0} else "\nThese runs had less work than usual; the numbers only show that the code runs.\n"
    )
    return HEAD.format(machine=machine(report)) + "".join(map(line, rows)) + note


def machine(report: dict[str, Any]) -> str:
    """Processor, system, versions and date in one line."""
    info, commit = report["machine_info"], report["commit_info"]
    cpu = info.get("cpu", {})
    name = cpu.get("brand_raw") or info.get("processor") or info.get("machine")
    dirty = ", changed since" if commit.get("dirty") else ""
    return (
        f"{name}, {cpu.get('count', '?')} cores, {info['system']}; {info['python_implementation']} "
        f"{info['python_version']}; commit {str(commit.get('id'))[:10]}{dirty}; {report['datetime'][:10]}."
    )


def line(row: dict[str, Any]) -> str:
    """A line of the table."""
    ratio, reference_rate = "", ""
    if row["against_rate"] is not None:
        ratio = f"{row['rate'] / row['against_rate']:.3g}"
        ratio += f" (aim {row['aim']:g})" if row["aim"] is not None else ""
        reference_rate = f"{number(row['against_rate'])} {row['unit']}"
    return f"| {row['what']} | {number(row['rate'])} {row['unit']} | {row['against']} | {reference_rate} | {ratio} |\n"


def number(value: float) -> str:
    """A number with three significant digits, or without decimals from 100 on."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def main(arguments: Iterable[str]) -> None:
    """Reads the first file and writes the second."""
    source, target = map(Path, arguments)
    target.write_text(page(json.loads(source.read_text(encoding="utf-8"))), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
