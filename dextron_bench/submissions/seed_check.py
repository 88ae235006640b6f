"""Verifies one seed of a submission: its rows, its result and its recordings, and its agent when it is run again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
from msgspec import structs
from msgspec.structs import replace

from dextron_bench.evaluation.declaration import Declaration
from dextron_bench.evaluation.episodes import Episode, fingerprint
from dextron_bench.evaluation.results import Replay, Result, scores_by_split
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.reaches import sources
from dextron_bench.runs import result_files
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, records
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.provenance import Provenance
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.submissions import bundle, episode_tables, playing, relaunch, replay_check
from dextron_bench.submissions.manifest import ClaimedResult, Manifest
from dextron_bench.submissions.recording_check import RecordingCheck
from dextron_bench.submissions.result_check import differences, distant_returns, same_platform
from dextron_bench.submissions.verdict import SeedFinding


@dataclass(frozen=True, slots=True)
class Playing:
    """How an agent runs again: its limits, whether it may run without a sandbox, and what hears of the progress."""

    limits: Limits = field(default_factory=Limits)
    trust: bool = False
    threads: int = 0
    report: Progress = no_progress


class SeedCheck:
    """The checks of one seed of an unpacked bundle; `rerun` needs a `check` before it."""

    def __init__(self, folder: Path, manifest: Manifest, seed: int, splits: Sequence[Split]) -> None:
        self._run, self._agent_files = RunFolder.of_seed(folder, seed), folder / bundle.AGENT
        self._manifest, self._seed, self._splits = manifest, seed, splits
        self._traces: dict[tuple[str, int], str] = {}  # The hash of each replayed episode.

    def check(self, threads: int, report: Progress) -> SeedFinding:
        """Checks rows, replays their actions, and compares result and recordings with the replay."""
        finding = SeedFinding(self._seed)
        try:
            table, result, made_by = self._read()
        except (bundle.BadBundle, atomic.DamagedFile) as error:
            finding.add(str(error))
            return finding
        if faults := list(episode_tables.faults(table, self._splits)):
            finding.add(*faults)
            return finding
        lenient = not same_platform(result.provenance)
        tolerance = replay_check.TOLERANCE if lenient else 0.0
        recordings = RecordingCheck(self._run, self._manifest.name, tolerance, report)
        replayed = self._replay(table, recordings, threads, report)
        for problem in recordings.problems:
            finding.add(problem)
        finding.episodes, finding.exact, finding.table = replayed.episodes, replayed.exact, replayed.rows
        finding.result = self._result(replayed, result.provenance)
        if result.provenance != made_by:
            finding.add("its result has another provenance than its run")
        self._compare(finding, replayed, result, table if lenient else None)
        for name in recordings.without_row(self._traces):
            finding.add(f"recordings/{name} belongs to no row of the splits")
        return finding

    def rerun(self, how: Playing) -> SeedFinding:
        """Runs the agent again and compares its episodes with the replayed ones."""
        finding, differing = SeedFinding(self._seed), []
        source = sources.open_source(self._manifest.reaches)
        total, done = sum(len(split) for split in self._splits), 0
        try:
            launch = relaunch.launch_of(self._manifest.agent, self._agent_files, how.trust)
            for split in self._splits:
                for row, episode in playing.play_shuffled(launch, source, split, self._seed, how.limits, how.threads):
                    done += 1
                    if fingerprint(episode) != self._traces[split.name, row]:
                        differing.append(f"{split.name} row {row}: the agent, run again, acts differently")
                    how.report(done, total, f"seed {self._seed}, running again")
        except (AgentError, bundle.BadBundle) as error:
            differing.append(str(error))
        finding.add(*differing)
        return finding

    def _read(self) -> tuple[pd.DataFrame, Result, Provenance]:
        """The table of episodes, the result and the provenance of the run; raises BadBundle, DamagedFile."""
        for file in (self._run.episodes, self._run.result, self._run.provenance):
            if not file.exists():
                raise bundle.BadBundle(f"lacks {file.name}")
            if file.suffix == ".json" and file.stat().st_size > bundle.LARGEST_JSON:
                raise bundle.BadBundle(f"has a {file.name} of more than {bundle.LARGEST_JSON / 2**20:g} MiB")
        table = episode_tables.read(self._run.episodes, self._splits)
        bundle.parse(self._run.result.read_bytes(), ClaimedResult, self._run.result)
        return table, result_files.read_result(self._run.result), records.read(self._run.provenance, Provenance)

    def _replay(
        self, table: pd.DataFrame, recordings: RecordingCheck, threads: int, report: Progress
    ) -> replay_check.Replayed:
        """Plays all rows again; keeps the hash of each episode and checks its recording."""
        causes = table.set_index(["split", "row"])["cause"].to_dict()

        def observe(split: str, row: int, episode: Episode) -> None:
            self._traces[split, row] = fingerprint(episode)
            recordings.check(split, row, episode, causes[split, row])

        def replaying(done: int, total: int, note: str = "") -> None:
            report(done, total, f"seed {self._seed}, replaying")

        source = sources.open_source(self._manifest.reaches)
        return replay_check.replay_table(source, self._splits, table, threads, replaying, observe)

    def _result(self, replayed: replay_check.Replayed, made_by: Provenance) -> Result:
        """The result computed from the episodes as they were played again, and how many of them are equal."""
        return Result(
            self._manifest.name,
            self._manifest.reaches,
            self._seed,
            splits=scores_by_split(replayed.rows),
            provenance=made_by,
            declared=Declaration(**structs.asdict(self._manifest.declared)),
            replay=Replay(replayed.episodes, replayed.exact),
        )

    def _compare(
        self,
        finding: SeedFinding,
        replayed: replay_check.Replayed,
        result: Result,
        foreign: pd.DataFrame | None,
    ) -> None:
        """Adds how the result and the rows differ from the replay.

        `foreign` is the table if it was made on another platform: the result must then follow from that table, and the
        table must agree with the replay in most episodes and in every mean return.
        """
        assert finding.result is not None
        if replayed.exact == replayed.episodes:
            finding.add(*differences(result, finding.result))
        elif foreign is None or replayed.alike < replay_check.AGREEING * replayed.episodes:
            finding.add(*replayed.differing)
        else:
            claimed = scores_by_split(foreign.sort_values(["split", "row"]))
            finding.add(*differences(result, replace(finding.result, splits=claimed)))
            finding.add(*distant_returns(result, finding.result))
            finding.notes.append(
                f"seed{self._seed}: made on another platform; of {replayed.episodes} episodes {replayed.exact} are "
                f"equal bit for bit, {replayed.alike} end alike with a last state within {replay_check.TOLERANCE:g}"
            )
