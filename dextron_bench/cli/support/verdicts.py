"""The verdict on a submission, as `leaderboard verify` and `add` print it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.storage.printable import printable_line

if TYPE_CHECKING:
    from dextron_bench.submissions.manifest import Manifest
    from dextron_bench.submissions.verdict import Verdict


@contextmanager
def unpacked(file: Path) -> Iterator[tuple[Path, Manifest]]:
    """Unpacks a bundle into a temporary folder; yields the folder and the manifest."""
    from dextron_bench.submissions import bundle as submission_bundle

    with TemporaryDirectory(prefix="dextron-bundle-") as folder:
        yield Path(folder), submission_bundle.unpack(file, Path(folder))


def print_verdict(verdict: Verdict) -> int:
    """Prints the result of a verification and returns the exit code."""
    name = f"{verdict.manifest.name} on {verdict.manifest.reaches} reaches"
    for note in verdict.notes:
        print(printable_line(f"note: {note}"))
    if verdict.passed:
        print(f"{name}: {verdict.tier}; {verdict.exact} of {verdict.episodes} episodes equal bit for bit")
        return DONE
    print(f"{name}: refused", *map(printable_line, verdict.problems), sep="\n  ")
    return DIFFERS
