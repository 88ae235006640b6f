"""Checking a submission: nothing that it says is believed that its actions, played again, do not show."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench import recording, records, splits
from dextron_bench.isolation import sandbox
from dextron_bench.isolation.agent import Launch, Limits, launch
from dextron_bench.rollout import AgentError, Episode
from dextron_bench.submission import bundle, contest, copies, replaying, tables
from dextron_bench.submission.differences import differences, same_platform
from dextron_bench.traces import trace
from dextron_bench.world import model, sources

Report = Callable[[str, int, int], None]  # Told (what, episodes done, all).
SHOWN = 5  # Problems of a kind that are told one by one.


@dataclass(slots=True)
class Verdict:
    """What checking found: problems that refuse a submission, notes that do not, and results computed anew."""

    manifest: dict[str, Any]
    tier: str = "replayed"
    episodes: int = 0
    exact: int = 0
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    results: dict[int, dict[str, Any]] = field(default_factory=dict)
    tables: dict[int, pd.DataFrame] = field(default_factory=dict)  # Of episodes, as they were played again.

    @property
    def sound(self) -> bool:
        """True where nothing speaks against the submission."""
        return not self.problems


def verify(
    folder: Path,
    manifest: dict[str, Any],
    board: Path | None = None,
    rerun: bool = False,
    threads: int = 0,
    limits: Limits | None = None,
    report: Report = lambda what, done, total: None,
) -> Verdict:
    """Checks an unpacked bundle (see `bundle.unpack`) against the splits, the engine and the results on a board.

    With `rerun` the agent is also run again, from the files in the bundle. Raises MissingData, OSError.
    """
    verdict = Verdict(manifest)
    if manifest["physics"] != model.mjcf_hash():
        verdict.problems.append("was played with other physics than this version's; submit it again with this version")
        return verdict
    if sorted(manifest["seeds"]) != list(range(len(manifest["seeds"]))):
        verdict.problems.append(f"has seeds {manifest['seeds']}; they must be 0, 1, 2 and so on, none chosen")
    wanted = [splits.load(manifest["reaches"], name) for name in splits.evaluated(manifest["reaches"])]
    seeds = [_Seed(folder, manifest, seed, wanted, verdict) for seed in manifest["seeds"]]
    for each in seeds:
        each.check(threads, report)
    if unasked := sorted(set(_seeds(folder)) - set(manifest["seeds"])):
        verdict.problems.append(f"seed{unasked[0]} is there, but not among the seeds that it claims")
    if rerun and verdict.sound:
        for place in folder.glob("seed*"):  # Or an agent could read from them what it is to do.
            shutil.rmtree(place)
        for each in seeds:
            each.rerun(limits or Limits(), threads, report)
        verdict.tier = "re-run" if verdict.sound else "replayed"
        if not sandbox.is_here():
            verdict.notes.append("bubblewrap is not here: the agent ran with your rights, watched by a hook alone")
    if len(verdict.results) > 1 and copies.all_equal(verdict.results):
        verdict.notes.append("all seeds have the same episodes: they count as one, not as several trainings")
    if board is not None and verdict.sound:
        same = list(copies.found(verdict.results, manifest["name"], board))
        (verdict.notes if rerun else verdict.problems).extend(same)
    return verdict


class _Seed:
    """One seed of a submission; what is found is noted in the verdict."""

    def __init__(
        self,
        folder: Path,
        manifest: dict[str, Any],
        seed: int,
        wanted: Sequence[splits.Split],
        verdict: Verdict,
    ) -> None:
        self._folder, self._manifest, self._seed = folder / f"seed{seed}", manifest, seed
        self._agent_files, self._wanted, self._verdict = folder / "agent", wanted, verdict
        self._traces: dict[tuple[str, int], str] = {}
        self._recorded: dict[tuple[str, int], Path] = {}
        self._claimed: dict[tuple[str, int], str] = {}
        self._lenient = False

    def check(self, threads: int, report: Report) -> None:
        """Checks rows, replays, result and recordings."""
        lacking = [
            name
            for name in (records.EPISODES, records.RESULT, records.PROVENANCE)
            if not (self._folder / name).exists()
        ]
        if lacking:
            self._object(f"lacks {lacking[0]}")
            return
        try:
            table = tables.read(self._folder / records.EPISODES, self._wanted)
            result = records.read_result(self._folder / records.RESULT)
            bundle.check(result, "result", self._folder / records.RESULT)
        except (bundle.BadBundle, records.DamagedRun) as error:
            self._object(str(error))
            return
        if faults := list(tables.faults(table, self._wanted)):
            self._object(*faults)
            return
        self._claimed = dict(zip(zip(table["split"], table["row"], strict=True), table["trace"], strict=True))
        self._lenient = not same_platform(result["provenance"])
        self._recorded = {_place(file): file for file in sorted((self._folder / "recordings").glob("*.rrd"))}
        source = sources.open_source(self._manifest["reaches"])
        found = replaying.again(
            source,
            self._wanted,
            table,
            threads,
            lambda *done: report(f"seed {self._seed}, replaying", *done),
            self._look,
        )
        self._judge(found, result)

    def rerun(self, limits: Limits, threads: int, report: Report) -> None:
        """Runs the agent again and holds its episodes against those that were recorded."""
        source, told = sources.open_source(self._manifest["reaches"]), self._manifest["agent"]
        total, done, other = sum(len(split.cases) for split in self._wanted), 0, []
        try:
            how = _launch(told, self._agent_files)
            for split in self._wanted:
                for row, episode in contest.shuffled(how, source, split, self._seed, limits, threads):
                    done += 1
                    if trace(episode) != self._traces[split.name, row]:
                        other.append(f"{split.name} row {row}: the agent, run again, acts otherwise")
                    report(f"seed {self._seed}, running again", done, total)
        except (AgentError, bundle.BadBundle) as error:
            other.append(str(error))
        self._object(*other)

    def _judge(self, found: replaying.Replayed, result: dict[str, Any]) -> None:
        verdict, computed = self._verdict, records.scores(found.rows)
        verdict.episodes += found.episodes
        verdict.exact += found.exact
        whose = {"method": self._manifest["name"], "reaches": self._manifest["reaches"], "seed": self._seed}
        told = result["provenance"]
        if told != records.read_json(self._folder / records.PROVENANCE):
            self._object("its result has another provenance than its run")
        if found.exact == found.episodes:
            self._object(*differences(result, whose | {"splits": computed, "provenance": told}))
        elif not self._lenient or found.alike < replaying.AGREEING * found.episodes:
            self._object(*found.differing)
        else:
            verdict.notes.append(
                f"seed{self._seed}: made on another platform; of {found.episodes} episodes {found.exact} are equal bit "
                f"for bit, {found.alike} end alike with a last state within {replaying.TOLERANCE:g}"
            )
        verdict.tables[self._seed] = found.rows
        verdict.results[self._seed] = {
            **whose, "splits": computed, "provenance": told, "declared": self._manifest["declared"]
        }  # fmt: skip
        for lost in sorted(self._recorded.keys() - self._traces.keys()):
            self._object(f"recordings/{self._recorded[lost].name} is of no row of the splits")

    def _look(self, split: str, row: int, episode: Episode) -> None:
        """Keeps an episode's hash, and holds its recording against it where there is one."""
        self._traces[split, row] = trace(episode)
        if not (file := self._recorded.get((split, row))):
            return
        try:
            told = recording.read_safely(file)
        except recording.BrokenRecording as error:
            self._object(str(error).replace(f"{self._folder}/", ""))
            return
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


def _seeds(folder: Path) -> list[int]:
    return [int(place.name.removeprefix("seed")) for place in folder.glob("seed*")]


def _launch(told: dict[str, Any], files: Path) -> Launch:
    """How to start the agent of a bundle from its own files; raises BadBundle where it brought none."""
    weights = files / told["weights"] if told["weights"] else None
    if told["kind"] == "exec":
        raise bundle.BadBundle("an agent that is a program of its own cannot be run again from its bundle")
    spec = str(files / told["spec"]) if told["kind"] == "policy" or ".py:" in told["spec"] else told["spec"]
    place = spec.rpartition(":")[0] if told["kind"] == "code" else spec
    for need in (weights, Path(place) if place.startswith(str(files)) else None):
        if need and not (need.resolve().parent == files.resolve() and need.is_file()):
            raise bundle.BadBundle(f"the bundle lacks the agent's file {need.name}")
    return launch(spec, told["settings"], weights)
