"""Verifies a baseline's row of the board: runs its code with the weights that ship again, and compares."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.evaluation import episode_table
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods import registry, weights
from dextron_bench.methods.agents import Agent, AgentError
from dextron_bench.reaches import sources
from dextron_bench.runs import execution, result_files
from dextron_bench.runs.plans import Plan, resolve, with_shipped_weights
from dextron_bench.splits.loading import Split, load_split, ranking_splits
from dextron_bench.storage.progress import Progress
from dextron_bench.storage.run_folder import RunFolder

NewAgent = Callable[[], Agent]


class NotReproducible(LookupError):
    """A row whose agent cannot be made again."""


@dataclass(slots=True)
class Finding:
    """What verification finds for a row: what was done, and the problems; none if the row is reproduced.

    `actions` are hashes of the actions on every split, if a baseline ran again on all rows.
    """

    done: str
    problems: list[str] = field(default_factory=list)
    actions: dict[str, list[str]] = field(default_factory=dict)


def rerun(run: RunFolder, result: dict[str, Any], count: int, threads: int, report: Progress) -> Finding:
    """Runs a row's agent again on `count` rows of each split, drawn at random; 0 takes all."""
    finding, done = Finding(""), 0
    total = sum(len(split["scores"]) for split in result["splits"].values())
    try:
        if missing := set(ranking_splits(result["reaches"])) - result["splits"].keys():
            finding.problems.append(f"lacks {', '.join(sorted(missing))}")
        new_agent = agents_of(run, result)
        for name, claimed in result["splits"].items():
            split = load_split(result["reaches"], name)
            if fault := _fault(claimed, split):
                finding.problems.append(fault)
                continue
            done += _rerun_split(new_agent, claimed, split, drawn_rows(len(split), count), threads, finding)
            report(done, total)
    except (NotReproducible, weights.MissingWeights, AgentError) as error:
        finding.problems.append(str(error))
    finding.done = f"run again, {done} of {total} episodes, all equal"
    return finding


def _fault(claimed: dict[str, Any], split: Split) -> str:
    """Why a split's scores cannot be compared with the split; empty if they can."""
    if split.digest != claimed["digest"]:
        return f"{split.name} is of another version of the split"
    if {len(claimed[name]) for name in ("scores", "actions") if name in claimed} != {len(split)}:
        return f"{split.name} must have one score and one hash of actions for each row of the split"
    return ""


def _rerun_split(
    new_agent: NewAgent, claimed: dict[str, Any], split: Split, rows: np.ndarray, threads: int, finding: Finding
) -> int:
    """Runs the agent on rows of a split and adds the differences; returns how many rows it played in the end."""
    table = play_rows(new_agent, split, rows, threads)
    computed, whole = result_files.scores_by_split(table)[split.name], len(rows) == len(split)
    differences = list(_differences(claimed, computed, rows, whole))
    if differences and not whole:  # An agent may draw numbers in an order that depends on the other episodes.
        return _rerun_split(new_agent, claimed, split, np.arange(len(split)), threads, finding)
    finding.problems += [f"{split.name} {difference}" for difference in differences]
    if whole:
        finding.actions[split.name] = computed["actions"]
    return len(rows)


def _differences(claimed: dict[str, Any], computed: dict[str, Any], rows: np.ndarray, whole: bool) -> Iterator[str]:
    """How the scores of a split differ from those computed on some of its rows, or on the whole."""
    for place, row in enumerate(rows):
        if claimed["scores"][row] != computed["scores"][place]:
            yield f"row {row}: says return {claimed['scores'][row]:g}; run again it is {computed['scores'][place]:g}"
        elif "actions" in claimed and claimed["actions"][row] != computed["actions"][place]:
            yield f"row {row}: says other actions than the agent, run again, chose"
    for name in ("failed", "causes", "closing_lag") if whole else ():
        if claimed[name] != computed[name]:
            yield f"says {name.replace('_', ' ')} {claimed[name]}; run again it is {computed[name]}"


def play_rows(new_agent: NewAgent, split: Split, rows: np.ndarray, threads: int) -> pd.DataFrame:
    """The table of the episodes of a new agent on some rows of a split."""
    source = sources.open_source(split.reaches)
    episodes = dict(rollout(new_agent(), source, split.rows(rows), threads=threads))
    return pd.DataFrame([episode_table.row(split, int(row), episodes[place]) for place, row in enumerate(rows)])


def drawn_rows(total: int, count: int) -> np.ndarray:
    """All row numbers, or `count` drawn at random, in order: nobody can know which rows are verified."""
    if not 0 < count < total:
        return np.arange(total)
    return np.sort(np.random.default_rng().choice(total, count, replace=False))


def agents_of(run: RunFolder, result: dict[str, Any]) -> NewAgent:
    """Makes agents of a row, from the code and the weights that ship; raises NotReproducible and others."""
    maker, seed = result.get("maker", {}), result["seed"]
    if maker.get("method") not in registry.installed_methods():
        raise NotReproducible("has neither its episodes nor a method that ships")
    shipped = resolve(Plan(maker["method"], result["reaches"], seed=seed, settings=maker["settings"]))
    claimed = RunFolder.of(run.path.parents[2], result["method"], result["reaches"], seed)
    if run.identity != claimed.identity or (result["method"], result["reaches"]) != (shipped.label, shipped.source):
        raise NotReproducible(f"lies in {run.identity}, but was made by {shipped.label} on {shipped.source} reaches")
    if shipped.learner is not None:
        shipped = with_shipped_weights(shipped, [seed])[0]
        assert shipped.plan.weights
        facts = weights.metadata(shipped.plan.weights)
        if differing := [name for name in ("sha256", *facts) if result["training"].get(name) != facts[name]]:
            raise NotReproducible(f"was made with other weights than those that ship: its {differing[0]} differs")
    return execution.agents(shipped, shipped.plan.weights)
