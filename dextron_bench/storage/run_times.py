"""When a run began and when it ended, in a file of its own: all other files are equal if a run is repeated.

Copying files may change their own times. Runs of version 0.1 do not have the file.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated

from msgspec import Meta

from dextron_bench.storage import atomic, records
from dextron_bench.storage.run_folder import RunFolder

Moment = Annotated[datetime, Meta(tz=True)]


@dataclass(frozen=True, slots=True)
class RunTimes:
    """When a run began, and when its result was written or it failed; None where this is not known."""

    began: Moment | None = None
    ended: Moment | None = None


def read(run: RunFolder) -> RunTimes:
    """The times of a run; raises DamagedFile."""
    return records.read(run.times, RunTimes) if run.times.exists() else RunTimes()


def note_begin(run: RunFolder) -> None:
    """Notes that a run begins, unless it has begun before."""
    if not run.times.exists():
        atomic.write_json(run.times, {"began": _now()})


def note_end(run: RunFolder) -> None:
    """Notes that a run has ended, in the place of an earlier end; raises DamagedFile."""
    began = read(run).began
    atomic.write_json(run.times, ({"began": began.isoformat()} if began else {}) | {"ended": _now()})


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
