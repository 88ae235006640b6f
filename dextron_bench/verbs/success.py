"""`dextron-bench success`: the success model's data set, its training, and how good it is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from dextron_bench.verbs.printing import print_json, print_table, progress_bar


@dataclass(frozen=True)
class Data:
    """Play the episodes that the success model learns from: of experts, and of trained policies.

    Killed at any moment, the same command goes on where it was and makes the same data set.

    Example: dextron-bench success data --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    rows: int = 1_000_000
    """Play until there are so many transitions."""
    policies: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE.safetensors")] = ()
    """Weights of the policies that play half of the episodes, in turn; without any, all are the experts'."""
    seed: int = 0
    """Seed of all draws."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor."""
    runs: Path = Path("runs")
    """Folder of all runs; the data set lives below it."""
    quiet: bool = False
    """Show no progress."""
    json: bool = False
    """Print the summary as JSON."""

    def __call__(self) -> int:
        from dextron_bench import splits, tensors, weights
        from dextron_bench.success import collection
        from dextron_bench.world.sources import open_source

        agents = {tensors.sha256(file): weights.own(file) for file in self.policies}
        wanted = collection.Collection(self.reaches, self.seed, tuple(agents))
        source, train = open_source(self.reaches), splits.load(self.reaches, "train").cases
        folder = folder_of(self.runs, self.reaches, self.seed)
        with progress_bar("transitions", self.quiet) as progress:
            found = collection.collect(source, train, wanted, folder, self.rows, agents, self.threads, progress)
        rows = [{"kind": kind, **tally.about()} for kind, tally in found.items() if tally.rows]
        rows.append({"kind": "all", **sum(found.values(), collection.Tally()).about()})
        if self.json:
            print_json(rows)
        else:
            print_table(f"data set in {folder}", list(rows[0]), [list(row.values()) for row in rows])
        return 0


@dataclass(frozen=True)
class Train:
    """Train the success model on a data set that `success data` made; four in five of its episodes are learned from.

    Killed at any moment, the same command goes on and ends with the same bytes.

    Example: dextron-bench success train --reaches synthetic --epochs 30
    """

    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    data: int = 0
    """Seed of the data set."""
    epochs: int = 30
    """How long to train, in epochs of 1,000 batches."""
    seed: int = 0
    """Seed of the network and its batches."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.success import fit

        folder = folder_of(self.runs, self.reaches, self.data)
        with progress_bar("epochs", self.quiet) as progress:
            fit.fit(folder, fit.Fit(epochs=self.epochs, seed=self.seed), progress)
        last = fit.curve(folder)[-1]
        columns = ["epoch", "loss", "accuracy", "test_loss", "test_accuracy"]
        print_table("the last epoch", columns, [[last[column] for column in columns]])
        print(folder / fit.MODEL)
        return 0


@dataclass(frozen=True)
class Eval:
    """Judge a success model on episodes that it never saw: of experts, and of trained policies, on splits.

    Half of the experts' episodes are played by experts that solve their setting, half by experts drawn uniformly.

    Example: dextron-bench success eval --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    model: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """The model; by default the one that `success train` made of the data set with seed 0."""
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
        from dextron_bench import splits, tensors, weights
        from dextron_bench.success import evaluation, fit
        from dextron_bench.success.network import SuccessModel
        from dextron_bench.world.sources import open_source

        file = self.model or folder_of(self.runs, self.reaches, 0) / fit.MODEL
        model, source = SuccessModel(tensors.read(file)), open_source(self.reaches)
        players = {"experts": None} | {str(policy): weights.own(policy) for policy in self.policies}
        rows = []
        for name in self.split or splits.evaluated(self.reaches):
            cases = splits.load(self.reaches, name).cases[: self.rows]
            for player, agent in players.items():
                played = cases if agent else evaluation.contrasted(cases)
                found = evaluation.evaluate(model, source, played, agent, self.threads)
                rows.append({"split": name, "player": player, **found.about()})
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
    """The model; by default the one that `success train` made of the data set with seed 0."""
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
        from dextron_bench import diagnosis, figures, rollout, splits, tensors, weights
        from dextron_bench.experts import ExpertAgent
        from dextron_bench.success import explanation, fit
        from dextron_bench.success.network import SuccessModel
        from dextron_bench.world.sources import open_source

        file = self.model or folder_of(self.runs, self.reaches, 0) / fit.MODEL
        model, source = SuccessModel(tensors.read(file)), open_source(self.reaches)
        cases = splits.load(self.reaches, self.split).cases[: self.rows]
        players = {explanation.EXPERT: ExpertAgent()} | {str(policy): weights.own(policy) for policy in self.policies}
        found = explanation.choose(
            explanation.foresee(model, source, player, episode, diagnosis.diagnose(episode, cases[row]))
            for player, agent in players.items()
            for row, episode in sorted(rollout.rollout(agent, source, cases, threads=self.threads), key=lambda e: e[0])
        )
        self.into.parent.mkdir(parents=True, exist_ok=True)
        figures.ridges({explanation.KINDS[kind]: seen for kind, seen in found.items()}, self.into)
        columns = ["kind", "player", "reach", "return", "cause", "steps foretold [%]"]
        cells = [
            [
                kind,
                seen.player,
                seen.episode.setting.reach,
                seen.episode.score,
                seen.diagnosis.cause,
                seen.foretold * 100,
            ]
            for kind, seen in found.items()
        ]
        print_table("episodes", columns, cells)
        print(self.into)
        return 0


def folder_of(runs: Path, reaches: str, seed: int) -> Path:
    """Where a data set lives, and what is trained on it."""
    return runs / "success" / reaches / f"seed{seed}"
