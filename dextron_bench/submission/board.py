"""Checking the published board: submissions by their actions, baselines by running code and weights again."""

from __future__ import annotations

import filecmp
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from dextron_bench import publication, records, rollout, run, splits, tensors, traces, weights
from dextron_bench.learning import Heir, Learner
from dextron_bench.submission import replaying, tables
from dextron_bench.world import sources

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


def rows(board: Path, wanted: Sequence[str] = ()) -> list[Row]:
    """The rows of a board, those of the wanted methods; raises NothingToVerify, DamagedRun."""
    files = sorted((board / publication.RESULTS).glob(f"*/*/seed*/{records.RESULT}"))
    found = [Row(file.parent, records.read_result(file)) for file in files]
    kept = [row for row in found if not wanted or row.result["method"] in wanted]
    if not kept:
        known = ", ".join(sorted({row.result["method"] for row in found})) or "none"
        raise NothingToVerify(f"{board} has no such rows; its methods: {known}")
    return kept


def check(
    row: Row, some: int = 0, threads: int = 0, report: Report = lambda done, total: None
) -> tuple[list[str], str]:
    """Problems of a row, none where its episodes give what it says, and what was done; `some` rows of each split."""
    if (row.folder / records.EPISODES).exists():
        return _replayed(row, threads, report)
    return _rerun(row, some, threads, report)


def _replayed(row: Row, threads: int, report: Report) -> tuple[list[str], str]:
    reaches = row.result["reaches"]
    wanted = [splits.load(reaches, name) for name in splits.evaluated(reaches)]
    table = tables.read(row.folder / records.EPISODES, wanted)
    if problems := list(tables.faults(table, wanted)):
        return problems, ""
    found = replaying.again(sources.open_source(reaches), wanted, table, threads, report)
    if records.scores(found.rows) != row.result["splits"]:
        return ["its result is not what its actions, played again, give", *found.differing[:5]], ""
    return [], f"replayed, {found.exact} of {found.episodes} episodes equal bit for bit"


def _rerun(row: Row, some: int, threads: int, report: Report) -> tuple[list[str], str]:
    problems, done, total = [], 0, sum(len(told["scores"]) for told in row.result["splits"].values())
    try:
        for name, told in row.result["splits"].items():
            split = splits.load(row.result["reaches"], name)
            if split.digest != told["digest"]:
                problems.append(f"{name} is of another version of the split")
                continue
            numbers = _chosen(len(split.cases), some)
            found = _played(row, split, numbers, told, threads)
            if found and some:  # Some agents, such as dice, act otherwise beside others.
                numbers = np.arange(len(split.cases))
                found = _played(row, split, numbers, told, threads)
            problems, done = problems + found, done + len(numbers)
            report(done, total)
    except (NothingToVerify, weights.MissingWeights, rollout.AgentError) as error:
        problems.append(str(error))
    return problems, f"run again, {done} of {total} episodes, all equal"


def _played(row: Row, split: splits.Split, numbers: np.ndarray, told: dict[str, Any], threads: int) -> list[str]:
    """What of some rows of a split is not as the result tells."""
    source, cases = sources.open_source(split.reaches), [split.cases[number] for number in numbers]
    found = rollout.rollout(_agent(row), source, cases, threads=threads)
    return [
        f"{split.name} row {numbers[place]}: {what}"
        for place, episode in found
        for what in _other(episode, told, int(numbers[place]))
    ]


def _other(episode: rollout.Episode, told: dict[str, Any], number: int) -> Iterator[str]:
    if episode.score != told["scores"][number]:
        yield f"says return {told['scores'][number]:g}; run again it is {episode.score:g}"
    elif "actions" in told and traces.of_actions([episode.actions[:, 0]])[0] != told["actions"][number]:
        yield "says other actions than those of the agent, run again"


def _chosen(count: int, some: int) -> np.ndarray:
    """All row numbers, or some drawn at random, in order: nobody can know which will be looked at."""
    if not 0 < some < count:
        return np.arange(count)
    return np.sort(np.random.default_rng().choice(count, some, replace=False))


def _agent(row: Row) -> rollout.Agent:
    """The agent of a baseline's row: from the code and the weights that ship; raises NothingToVerify and others."""
    told, seed = row.result.get("maker", {}), row.result["seed"]
    if "method" not in told or told["code"]["sha256"]:
        raise NothingToVerify("has neither its episodes nor a method that ships")
    plan = run.Plan(told["method"], row.result["reaches"], (), seed, settings=told["settings"])
    method = plan.make()
    if isinstance(method, Heir | Learner):
        plan = run.shipped(plan, [seed])[0]
        assert plan.weights
        if tensors.sha256(plan.weights) != row.result["training"]["sha256"]:
            raise NothingToVerify("was made with other weights than those that ship")
    return run.agent(method, seed, plan.weights)


def pages(board: Path) -> list[str]:
    """Files of the board that are not what its results give; pictures are only looked for."""
    with TemporaryDirectory() as folder:
        again = Path(folder) / "board"
        shutil.copytree(board, again)
        publication.build(again)
        made = [file for file in sorted(again.iterdir()) if file.suffix in (".md", ".csv", ".json", ".html")]
        return [f"{file.name} differs" for file in made if not _same(file, board / file.name)]


def _same(file: Path, other: Path) -> bool:
    return other.exists() and filecmp.cmp(file, other, shallow=False)
