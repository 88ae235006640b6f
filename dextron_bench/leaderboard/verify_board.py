"""Checking the published board: submissions by their actions, baselines by running code and weights again."""

from __future__ import annotations

import filecmp
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.evaluation import episode_table
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.leaderboard import build, collect
from dextron_bench.leaderboard.highlights import FOLDER
from dextron_bench.leaderboard.submission import bundle, episode_tables, replay_check
from dextron_bench.methods import agents, registry, weights
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.reaches import sources
from dextron_bench.reaches.recorded.cache import MissingData
from dextron_bench.runs import execution, plans, result_files, run_files
from dextron_bench.splits.loading import Split, load_split, ranking_splits
from dextron_bench.storage import atomic

Report = Callable[[int, int], None]  # Told (episodes done, all).


class NothingToVerify(LookupError):
    """No row to check."""


@dataclass(frozen=True, slots=True)
class Row:
    """A result on the board."""

    folder: Path
    result: dict[str, Any]

    @property
    def name(self) -> str:
        """Method, source of reaches and seed."""
        return f"{self.result['method']}, {self.result['reaches']} reaches, seed {self.result['seed']}"


def rows(board: Path, wanted: Sequence[str] = (), reaches: Sequence[str] = ()) -> list[Row]:
    """The rows of a board, those of the wanted methods and sources; raises NothingToVerify, DamagedFile."""
    files = sorted((board / collect.RESULTS).glob(f"*/*/seed*/{result_files.RESULT}"))
    found = [Row(file.parent, result_files.read_result(file)) for file in files]
    kept = [row for row in found if not wanted or row.result["method"] in wanted]
    kept = [row for row in kept if not reaches or row.result["reaches"] in reaches]
    if not kept:
        known = ", ".join(sorted({row.result["method"] for row in found})) or "none"
        raise NothingToVerify(f"{board} has no such rows; its methods: {known}")
    return kept


@dataclass(slots=True)
class Finding:
    """What checking a row found: problems, none where its episodes give what it says, and what was done.

    `actions` are hashes of the actions on every split, where a baseline was run again on all rows.
    """

    done: str
    problems: list[str] = field(default_factory=list)
    actions: dict[str, list[str]] = field(default_factory=dict)


def check(row: Row, some: int = 0, threads: int = 0, report: Report = lambda done, total: None) -> Finding:
    """Checks a row of a board; of a baseline's splits `some` rows drawn at random, 0 for all."""
    try:
        if (row.folder / run_files.EPISODES).exists():
            return _replayed(row, threads, report)
        return _rerun(row, some, threads, report)
    except MissingData as error:
        return Finding("", [f"not checked: {error}"])


def stamp(row: Row, finding: Finding) -> bool:
    """Notes in a baseline's result that its agent was run again on all rows, and what it did; false if it was not."""
    if finding.problems or finding.actions.keys() != row.result["splits"].keys():
        return False
    told = {name: split | {"actions": finding.actions[name]} for name, split in row.result["splits"].items()}
    atomic.write_json(row.folder / result_files.RESULT, {**row.result, "splits": told, "tier": "re-run"})
    return True


def _replayed(row: Row, threads: int, report: Report) -> Finding:
    reaches = row.result["reaches"]
    wanted = [load_split(reaches, name) for name in ranking_splits(reaches)]
    table = episode_tables.read(row.folder / run_files.EPISODES, wanted)
    if problems := list(episode_tables.faults(table, wanted)):
        return Finding("", problems)
    found = replay_check.again(sources.open_source(reaches), wanted, table, threads, report)
    manifest = atomic.read_json(row.folder.parent / bundle.MANIFEST)
    told = [row.result.get(name) for name in ("method", "reaches", "declared")]
    if told != [manifest.get(name) for name in ("name", "reaches", "declared")]:
        return Finding("", ["its name, reaches or declarations are not those that its manifest has"])
    if problem := _misplaced(row, [f"seed{seed}" for seed in manifest.get("seeds", [])]):
        return Finding("", [problem])
    if result_files.scores(found.rows) != row.result["splits"]:
        return Finding("", ["its result is not what its actions, played again, give", *found.differing[:5]])
    return Finding(f"replayed, {found.exact} of {found.episodes} episodes equal bit for bit")


def _misplaced(row: Row, seeds: Sequence[str]) -> str:
    """What is wrong with where a row of a submission lies; nothing where it lies among all its seeds, and no others."""
    place, own = "/".join(row.folder.parts[-3:]), (row.result["method"], row.result["reaches"])
    if place != "/".join((*own, f"seed{row.result['seed']}")):
        return f"lies in {place}, but is of {row.name}"
    there = sorted(folder.name for folder in row.folder.parent.glob("seed*"))
    return "" if there == sorted(seeds) else f"has {', '.join(there)} where its manifest has {', '.join(seeds)}"


def _rerun(row: Row, some: int, threads: int, report: Report) -> Finding:
    found, done = Finding(""), 0
    total = sum(len(told["scores"]) for told in row.result["splits"].values())
    try:
        if lacking := set(ranking_splits(row.result["reaches"])) - row.result["splits"].keys():
            found.problems.append(f"lacks {', '.join(sorted(lacking))}")
        for name in row.result["splits"]:
            split = load_split(row.result["reaches"], name)
            told = row.result["splits"][name]
            if split.digest != told["digest"]:
                found.problems.append(f"{name} is of another version of the split")
                continue
            if {len(told[each]) for each in ("scores", "actions") if each in told} != {len(split.cases)}:
                found.problems.append(f"{name} has not one score and one hash of actions for each row of the split")
                continue
            done += _rerun_split(row, split, _chosen(len(split.cases), some), threads, found)
            report(done, total)
    except (NothingToVerify, weights.MissingWeights, agents.AgentError) as error:
        found.problems.append(str(error))
    found.done = f"run again, {done} of {total} episodes, all equal"
    return found


def _rerun_split(row: Row, split: Split, numbers: np.ndarray, threads: int, found: Finding) -> int:
    """Runs a row's agent on rows of a split, notes what it finds; returns how many were played in the end."""
    source, cases = sources.open_source(split.reaches), [split.cases[number] for number in numbers]
    played = dict(rollout(_agent(row), source, cases, threads=threads))
    told, whole = row.result["splits"][split.name], len(numbers) == len(split.cases)
    rows = [episode_table.row(split, int(number), played[place]) for place, number in enumerate(numbers)]
    made = result_files.scores(pd.DataFrame(rows))[split.name]
    problems = [f"{split.name} {what}" for what in _other(told, made, numbers, whole)]
    if problems and not whole:  # Some agents, such as dice, act otherwise beside others.
        return _rerun_split(row, split, np.arange(len(split.cases)), threads, found)
    found.problems += problems
    if whole:
        found.actions[split.name] = made["actions"]
    return len(numbers)


def _other(told: dict[str, Any], made: dict[str, Any], numbers: np.ndarray, whole: bool) -> Iterator[str]:
    """Where what a result says of a split is not what was made on some of its rows, or on the whole."""
    for place, number in enumerate(numbers):
        if told["scores"][number] != made["scores"][place]:
            yield f"row {number}: says return {told['scores'][number]:g}; run again it is {made['scores'][place]:g}"
        elif "actions" in told and told["actions"][number] != made["actions"][place]:
            yield f"row {number}: says other actions than those of the agent, run again"
    for name in ("failed", "causes", "closing_lag") if whole else ():
        if told[name] != made[name]:
            yield f"says {name.replace('_', ' ')} {told[name]}; run again it is {made[name]}"


def _chosen(count: int, some: int) -> np.ndarray:
    """All row numbers, or some drawn at random, in order: nobody can know which will be looked at."""
    if not 0 < some < count:
        return np.arange(count)
    return np.sort(np.random.default_rng().choice(count, some, replace=False))


def _agent(row: Row) -> agents.Agent:
    """The agent of a baseline's row: from the code and the weights that ship; raises NothingToVerify and others."""
    told, seed = row.result.get("maker", {}), row.result["seed"]
    if told.get("method") not in registry.known():
        raise NothingToVerify("has neither its episodes nor a method that ships")
    plan = plans.Plan(told["method"], row.result["reaches"], (), seed, settings=told["settings"])
    method = plan.make()
    place, claimed = row.folder.parts[-3:], (row.result["method"], row.result["reaches"], f"seed{seed}")
    if place != claimed or claimed[:2] != (plan.label, plan.source):
        raise NothingToVerify(f"lies in {'/'.join(place)}, but was made by {plan.label} on {plan.source} reaches")
    if isinstance(method, PolicyTransfer | Learner):
        plan = plans.shipped(plan, [seed])[0]
        assert plan.weights
        told, true = row.result["training"], weights.about(plan.weights)
        if other := [name for name in ("sha256", *true) if told.get(name) != true[name]]:
            raise NothingToVerify(f"was made with other weights than those that ship: its {other[0]} is another")
    return execution.agent(method, seed, plan.weights)


def pages(board: Path) -> list[str]:
    """Files of the board that are not what its results give; pictures are only looked for."""
    with TemporaryDirectory() as folder:
        again = Path(folder) / "board"
        shutil.copytree(board, again)
        if (beside := board.resolve().parent / FOLDER).exists():
            (Path(folder) / FOLDER).symlink_to(beside)  # The page tells of the recordings beside the board.
        build.build(again)
        made = [file for file in sorted(again.iterdir()) if file.suffix in (".md", ".csv", ".json", ".html")]
        return [f"{file.name} differs" for file in made if not _same(file, board / file.name)]


def _same(file: Path, other: Path) -> bool:
    return other.exists() and filecmp.cmp(file, other, shallow=False)
