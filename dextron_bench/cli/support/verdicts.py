"""The verdict on a submission, as `leaderboard verify` and `add` print it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import print_table
from dextron_bench.storage.printable import printable, printable_line

if TYPE_CHECKING:
    from dextron_bench.submissions.verdict import Verdict


@contextmanager
def unpacked(file: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Unpacks a bundle into a temporary folder; yields the folder and the manifest."""
    from dextron_bench.submissions import bundle as submission_bundle

    with TemporaryDirectory(prefix="dextron-bundle-") as folder:
        yield Path(folder), submission_bundle.unpack(file, Path(folder))


def print_verdict(verdict: Verdict) -> int:
    """Prints the result of a verification and returns the exit code."""
    name = f"{verdict.manifest['name']} on {verdict.manifest['reaches']} reaches"
    for note in verdict.notes:
        print(printable_line(f"note: {note}"))
    if verdict.passed:
        print(f"{name}: {verdict.tier}; {verdict.exact} of {verdict.episodes} episodes equal bit for bit")
        print_fresh(verdict)
        return DONE
    print(f"{name}: refused", *map(printable_line, verdict.problems), sep="\n  ")
    return DIFFERS


def print_fresh(verdict: Verdict) -> None:
    """Prints what the agent scored on fresh settings, beside its scores on the splits, if it played any."""
    from dextron_bench.scores import cells, standings

    rows = standings.table(verdict.results.values())
    if not rows["fresh"].notna().any():
        return
    beacon = next(iter(verdict.results.values()))["fresh"]["beacon"]
    lines = [
        [
            row["split"],
            cells.mean_return(row),
            cells.fresh(row),
            cells.gap(row),
            "beyond noise" if row["marked"] else "",
        ]
        for row in rows.to_dict("records")
    ]
    print_table(f"fresh settings, beacon {printable(beacon)}", ["split", "return", "fresh", "gap", ""], lines)
