"""`dextron-bench success eval` and `success explain`: evaluates the success model and draws its predictions."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.success.model import folder_of
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_markdown, print_table
from dextron_bench.reaches.sources import RankedSource

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dextron_bench.splits.loading import Split
    from dextron_bench.splits.rows import Rows
    from dextron_bench.success.exemplars import PredictedEpisode
    from dextron_bench.success.network import SuccessModel


EXPERTS = "experts"  # What the rows of experts are called; other rows are called after a file of weights.


class NoRows(ValueError):
    """A number of rows below 1."""


@dataclass(frozen=True)
class Eval:
    """Evaluate a success model on new episodes of experts and of trained policies.

    In half of the experts' episodes the expert solves the setting; in the other half it is drawn at random.

    Example: dextron-bench success eval --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: RankedSource = "synthetic"
    """The source of reaches."""
    model: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """The model; by default the model of the data set with seed 0 in --runs, or the shipped one."""
    split: tuple[str, ...] = ()
    """The splits; by default all splits that rank methods."""
    rows: int = 200
    """How many settings of each split to play, from the first."""
    policies: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE.safetensors")] = ()
    """Weights of policies to evaluate the model on too."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    threads: int = 0
    """Threads of the simulation; 0 means one per processor."""
    json: bool = False
    """Print the rows as JSON, with the AUC by time and the calibration."""
    markdown: bool = False
    """Print the same as Markdown, for a document."""

    def __call__(self) -> int:
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits.loading import load_split, ranking_splits
        from dextron_bench.success import evaluation

        model, source = load_model(self.model, self.runs, self.reaches), open_source(self.reaches)
        players = {EXPERTS: None} | {str(policy): weights.load_agent_from_file(policy) for policy in self.policies}
        rows = []
        for name in self.split or ranking_splits(self.reaches):
            whole = _first(load_split(self.reaches, name), self.rows)
            for player, agent in players.items():
                played = whole if agent else evaluation.with_random_experts(whole)
                result = evaluation.evaluate(model, source, played, agent, self.threads)
                rows.append({"split": name, "player": player, **result.as_dict()})
        if self.json:
            print_json(rows)
        elif self.markdown:
            _print_markdown(rows)
        else:
            columns = [column for column, value in rows[0].items() if not isinstance(value, list)]
            print_table("success model", columns, [[row[column] for column in columns] for row in rows])
        return DONE


@dataclass(frozen=True)
class Explain:
    """Draw the predictions of a success model in five kinds of episodes that the command selects (paper, Fig. 5).

    Example: dextron-bench success explain --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: RankedSource = "synthetic"
    """The source of reaches."""
    model: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """The model; by default the model of the data set with seed 0 in --runs, or the shipped one."""
    split: str = "test"
    """The split that experts and policies play."""
    rows: int = 100
    """How many settings of it to play, from the first."""
    policies: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE.safetensors")] = ()
    """Weights of the policies whose episodes to choose from."""
    into: Path = Path("figures/fig5.png")
    """The file for the picture."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    threads: int = 0
    """Threads of the simulation; 0 means one per processor."""

    def __call__(self) -> int:
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.scores.figures.episodes import ridges
        from dextron_bench.splits.loading import load_split
        from dextron_bench.success import exemplars

        model, source = load_model(self.model, self.runs, self.reaches), open_source(self.reaches)
        rows = _first(load_split(self.reaches, self.split), self.rows)
        policies = {str(policy): weights.load_agent_from_file(policy) for policy in self.policies}
        chosen = exemplars.choose(exemplars.play_and_predict(model, source, rows, policies, self.threads))
        self.into.parent.mkdir(parents=True, exist_ok=True)
        ridges({exemplars.KINDS[kind]: episode for kind, episode in chosen.items()}, self.into)
        _print_exemplars(chosen, rows)
        if missing := [title for kind, title in exemplars.KINDS.items() if kind not in chosen]:
            print(f"dextron-bench: no episode of this kind: {'; '.join(missing)}", file=sys.stderr)
        print(self.into)
        return DONE


def _print_markdown(rows: Sequence[Mapping[str, Any]]) -> None:
    """Prints three tables: the scores, the AUC by time, and the calibration on the first split."""
    heads = ["success [%]", "accuracy [%]", "base-rate accuracy [%]", "Brier", "base-rate Brier", "calibration error"]
    print_markdown(["split", "agent", "transitions", *heads, "AUC"], [[*_names(row), *_scores(row)] for row in rows])
    print()
    tenths = [f"{10 * k}-{10 * k + 10}" for k in range(10)]
    print_markdown(
        ["split", "agent", *tenths, "after"], [[*_names(row), *_rounded(row["auc_by_time"])] for row in rows]
    )
    print()
    first = [row for row in rows if row["split"] == rows[0]["split"]]
    bins = [f"{k / 10:.1f}-{(k + 1) / 10:.1f}" for k in range(10)]
    print_markdown(["agent", *bins], [[_names(row)[1], *_rounded(row["observed"])] for row in first])


def _names(row: Mapping[str, Any]) -> list[str]:
    """The split and the agent of a row."""
    from dextron_bench.storage import tensors

    is_expert = row["player"] == EXPERTS
    return [f"`{row['split']}`", EXPERTS if is_expert else tensors.read_about(Path(row["player"]))["label"]]


def _scores(row: Mapping[str, Any]) -> list[str]:
    """The cells of a row's scores."""
    shares = [100 * row[name] for name in ("base_rate", "accuracy", "base_accuracy")]
    scores = [row[name] for name in ("brier", "base_brier", "calibration_error", "auc")]
    return [f"{row['rows']:,}", *_rounded(shares, 1), *_rounded(scores, 3)]


def _rounded(values: Iterable[float | None], digits: int = 2) -> list[str]:
    """Cells of numbers; empty for None and NaN."""
    return ["" if value is None or math.isnan(value) else f"{value:.{digits}f}" for value in values]


def _print_exemplars(chosen: Mapping[str, PredictedEpisode], played: Rows) -> None:
    columns = ["kind", "player", "row", "reach", "return", "cause", "correct steps [%]"]
    numbers = {case.setting: row for row, case in enumerate(played.cases)}
    rows = []
    for kind, predicted in chosen.items():
        episode = predicted.episode
        case = numbers[episode.setting], episode.setting.reach
        outcome = episode.score, predicted.diagnosis.cause, 100 * predicted.accuracy
        rows.append([kind, predicted.player, *case, *outcome])
    print_table("episodes", columns, rows)


def _first(split: Split, rows: int) -> Rows:
    if rows < 1:
        raise NoRows(f"--rows must be 1 or more, not {rows}")
    return split.first(rows)


def load_model(file: Path | None, runs: Path, reaches: str) -> SuccessModel:
    """The model in a file; without one, the model trained in a folder of runs, or else the shipped one."""
    from dextron_bench.storage import tensors
    from dextron_bench.success import network, training

    trained = folder_of(runs, reaches, 0) / training.MODEL
    if file is None and not trained.exists():
        return network.shipped_model(reaches)
    path = file or trained
    source = tensors.read_about(path).get("data", {}).get("search", {}).get("reaches", reaches)
    if source != reaches:
        print(f"dextron-bench: {path} was trained on {source} reaches, not on {reaches} ones", file=sys.stderr)
    return network.SuccessModel(tensors.read(path))
