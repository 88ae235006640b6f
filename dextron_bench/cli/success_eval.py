"""`dextron-bench success eval` and `success explain`: how good the success model is, and episodes that show it."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from dextron_bench.cli.output import print_json, print_table
from dextron_bench.cli.success import folder_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dextron_bench.experts.policies import Case
    from dextron_bench.success.network import SuccessModel


class NoRows(ValueError):
    """A wish for no row of a split."""


@dataclass(frozen=True)
class Eval:
    """Judge a success model on episodes that it never saw: of experts, and of trained policies, on splits.

    Half of the experts' episodes are played by experts that solve their setting, half by experts drawn uniformly.

    Example: dextron-bench success eval --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    model: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """The model; by default that of the data set with seed 0 in --runs, and where there is none the one that ships."""
    split: tuple[str, ...] = ()
    """The splits; by default all that rank methods."""
    rows: int = 200
    """Settings of each split that are played."""
    policies: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE.safetensors")] = ()
    """Weights of policies whose episodes are foretold too."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor."""
    json: bool = False
    """Print the rows as JSON, with the AUC by time of the reach, and the calibration."""

    def __call__(self) -> int:
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits.loading import load_split, ranking_splits
        from dextron_bench.success import evaluation

        model, source = chosen(self.model, self.runs, self.reaches), open_source(self.reaches)
        players = {"experts": None} | {str(policy): weights.load_agent_from_file(policy) for policy in self.policies}
        rows = []
        for name in self.split or ranking_splits(self.reaches):
            cases = _first(load_split(self.reaches, name).cases, self.rows)
            for player, agent in players.items():
                played = cases if agent else evaluation.with_random_experts(cases)
                found = evaluation.evaluate(model, source, played, agent, self.threads)
                rows.append({"split": name, "player": player, **found.as_dict()})
        if self.json:
            print_json(rows)
        else:
            columns = [column for column, value in rows[0].items() if not isinstance(value, list)]
            print_table("success model", columns, [[row[column] for column in columns] for row in rows])
        return 0


@dataclass(frozen=True)
class Explain:
    """Draw what a success model thinks at every step of five kinds of episodes that it finds by itself (Fig. 5).

    Example: dextron-bench success explain --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    model: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """The model; by default that of the data set with seed 0 in --runs, and where there is none the one that ships."""
    split: str = "test"
    """The split on which experts and policies are played."""
    rows: int = 100
    """Settings of it that are played."""
    policies: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE.safetensors")] = ()
    """Weights of the policies among which episodes are sought."""
    into: Path = Path("figures/fig5.png")
    """The picture."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor."""

    def __call__(self) -> int:
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.scores import figures
        from dextron_bench.splits.loading import load_split
        from dextron_bench.success import exemplars

        model, source = chosen(self.model, self.runs, self.reaches), open_source(self.reaches)
        cases = _first(load_split(self.reaches, self.split).cases, self.rows)
        policies = {str(policy): weights.load_agent_from_file(policy) for policy in self.policies}
        found = exemplars.choose(exemplars.play_and_predict(model, source, cases, policies, self.threads))
        self.into.parent.mkdir(parents=True, exist_ok=True)
        figures.ridges({exemplars.KINDS[kind]: seen for kind, seen in found.items()}, self.into)
        columns = ["kind", "player", "row", "reach", "return", "cause", "steps foretold [%]"]
        numbers = {case.setting: row for row, case in enumerate(cases)}
        cells = [
            [
                kind,
                seen.player,
                numbers[seen.episode.setting],
                seen.episode.setting.reach,
                seen.episode.score,
                seen.diagnosis.cause,
                seen.accuracy * 100,
            ]
            for kind, seen in found.items()
        ]
        print_table("episodes", columns, cells)
        if lacking := [told for kind, told in exemplars.KINDS.items() if kind not in found]:
            print(f"dextron-bench: none of these episodes shows: {'; '.join(lacking)}", file=sys.stderr)
        print(self.into)
        return 0


def _first(cases: Sequence[Case], rows: int) -> Sequence[Case]:
    if rows < 1:
        raise NoRows(f"--rows is how many settings of a split are played, 1 or more, not {rows}")
    return cases[:rows]


def chosen(file: Path | None, runs: Path, reaches: str) -> SuccessModel:
    """The model of a file; else the one trained in a folder of runs; else the one that ships."""
    from dextron_bench.storage import tensors
    from dextron_bench.success import network, training

    own = folder_of(runs, reaches, 0) / training.MODEL
    if file is None and not own.exists():
        return network.shipped_model(reaches)
    place = file or own
    learned = tensors.read_about(place).get("data", {}).get("search", {}).get("reaches", reaches)
    if learned != reaches:
        print(f"dextron-bench: {place} learned from {learned} reaches, these are {reaches} ones", file=sys.stderr)
    return network.SuccessModel(tensors.read(place))
