"""What one seed of a submission claims, held against the engine, its recordings, and its agent run again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench import recording
from dextron_bench.evaluation.episodes import Episode, trace
from dextron_bench.leaderboard.submission import bundle, episode_tables, playing, relaunch, replay_check
from dextron_bench.leaderboard.submission.result_check import differences, same_platform
from dextron_bench.leaderboard.submission.verdict import Verdict
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.reaches import sources
from dextron_bench.runs import result_files, run_files
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic

Report = Callable[[str, int, int], None]  # Told (what, episodes done, all).
SHOWN = 5  # Problems of a kind that are told one by one.


class Seed:
    """One seed of a submission; what is found is noted in the verdict."""

    def __init__(
        self,
        folder: Path,
        manifest: dict[str, Any],
        seed: int,
        wanted: Sequence[Split],
        verdict: Verdict,
    ) -> None:
        self._folder, self._manifest, self._seed = folder / f"seed{seed}", manifest, seed
        self._agent_files, self._wanted, self._verdict = folder / "agent", wanted, verdict
        self._traces: dict[tuple[str, int], str] = {}
        self._recorded: dict[tuple[str, int], recording.Summary] = {}
        self._claimed: dict[tuple[str, int], str] = {}
        self._lenient = False

    def check(self, threads: int, report: Report) -> None:
        """Checks rows, replays, result and recordings."""
        try:
            table, result = self._read()
        except (bundle.BadBundle, atomic.DamagedFile) as error:
            self._object(str(error))
            return
        if faults := list(episode_tables.faults(table, self._wanted)):
            self._object(*faults)
            return
        self._claimed = dict(zip(zip(table["split"], table["row"], strict=True), table["trace"], strict=True))
        self._lenient = not same_platform(result["provenance"])
        self._recorded = self._screened(report)
        source, what = sources.open_source(self._manifest["reaches"]), f"seed {self._seed}, replaying"
        found = replay_check.again(source, self._wanted, table, threads, lambda *done: report(what, *done), self._look)
        self._judge(found, result)

    def _read(self) -> tuple[pd.DataFrame, dict[str, Any]]:
        """The table of episodes and the result; raises BadBundle, DamagedFile."""
        for name in (run_files.EPISODES, result_files.RESULT, run_files.PROVENANCE):
            if not (self._folder / name).exists():
                raise bundle.BadBundle(f"lacks {name}")
        table = episode_tables.read(self._folder / run_files.EPISODES, self._wanted)
        result = result_files.read_result(self._folder / result_files.RESULT)
        bundle.check(result, "result", self._folder / result_files.RESULT)
        return table, result

    def _screened(self, report: Report) -> dict[tuple[str, int], recording.Summary]:
        """What the recordings say of themselves, by split and row."""
        files, found = sorted((self._folder / "recordings").glob("*.rrd")), {}
        for summary in recording.screen(files):
            found[_place(summary.file)] = summary
            report(f"seed {self._seed}, recordings", len(found), len(files))
        return found

    def rerun(self, limits: Limits, threads: int, report: Report) -> None:
        """Runs the agent again and holds its episodes against those that were recorded."""
        source, told = sources.open_source(self._manifest["reaches"]), self._manifest["agent"]
        total, done, other = sum(len(split.cases) for split in self._wanted), 0, []
        try:
            how = relaunch.launch_of(told, self._agent_files)
            for split in self._wanted:
                for row, episode in playing.shuffled(how, source, split, self._seed, limits, threads):
                    done += 1
                    if trace(episode) != self._traces[split.name, row]:
                        other.append(f"{split.name} row {row}: the agent, run again, acts otherwise")
                    report(f"seed {self._seed}, running again", done, total)
        except (AgentError, bundle.BadBundle) as error:
            other.append(str(error))
        self._object(*other)

    def _judge(self, found: replay_check.Replayed, result: dict[str, Any]) -> None:
        verdict, computed = self._verdict, result_files.scores(found.rows)
        verdict.episodes += found.episodes
        verdict.exact += found.exact
        whose = {"method": self._manifest["name"], "reaches": self._manifest["reaches"], "seed": self._seed}
        told = result["provenance"]
        if told != atomic.read_json(self._folder / run_files.PROVENANCE):
            self._object("its result has another provenance than its run")
        if found.exact == found.episodes:
            self._object(*differences(result, whose | {"splits": computed, "provenance": told}))
        elif not self._lenient or found.alike < replay_check.AGREEING * found.episodes:
            self._object(*found.differing)
        else:
            verdict.notes.append(
                f"seed{self._seed}: made on another platform; of {found.episodes} episodes {found.exact} are equal bit "
                f"for bit, {found.alike} end alike with a last state within {replay_check.TOLERANCE:g}"
            )
        verdict.tables[self._seed] = found.rows
        verdict.results[self._seed] = {
            **whose, "splits": computed, "provenance": told, "declared": self._manifest["declared"]
        }  # fmt: skip
        for lost in sorted(self._recorded.keys() - self._traces.keys()):
            self._object(f"recordings/{self._recorded[lost].file.name} is of no row of the splits")

    def _look(self, split: str, row: int, episode: Episode) -> None:
        """Keeps an episode's hash, and holds its recording against it where there is one."""
        self._traces[split, row] = trace(episode)
        if not (summary := self._recorded.get((split, row))):
            return
        try:
            told = recording.read_screened(summary)
        except recording.BrokenRecording as error:
            self._object(str(error).replace(f"{self._folder}/", ""))
            return
        file = summary.file
        right = {trace(episode)} | ({self._claimed[split, row]} if self._lenient else set())
        if trace(told.episode) not in right or told.episode.setting != episode.setting:
            self._object(f"recordings/{file.name} is not of the episode that its actions give")
        whose = {"method": self._manifest["name"], "seed": self._seed, "split": split, "row": row}
        if other := [name for name, value in whose.items() if told.properties.get(name) != value]:
            self._object(
                f"recordings/{file.name} says {other[0]} {told.properties.get(other[0])}, not {whose[other[0]]}"
            )

    def _object(self, *problems: str) -> None:
        lines = [f"seed{self._seed}: {problem}" for problem in problems]
        more = [f"seed{self._seed}: and {len(lines) - SHOWN} more of this kind"] if len(lines) > SHOWN else []
        self._verdict.problems += lines[:SHOWN] + more


def _place(file: Path) -> tuple[str, int]:
    split, _, row = file.stem.rpartition("-")
    return split, int(row)
