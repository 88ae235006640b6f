"""`dextron-bench success eval`: evaluates the success model on new episodes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_markdown, print_table
from dextron_bench.cli.support.rows import first
from dextron_bench.cli.support.success_models import load_model

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dextron_bench.success.evaluation import Evaluation
    from dextron_bench.success.metrics import Metrics


EXPERTS = "experts"  # What the rows of experts are called; other rows are called after a file of weights.


@dataclass(frozen=True)
class Eval:
    """Evaluate a success model on new episodes of experts and of trained policies.

    In half of the experts' episodes the expert solves the setting; in the other half it is drawn at random.

    Example: dextron-bench success eval --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: flags.RankedReaches = "synthetic"
    model: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """The model; by default the model of the data set with seed 0 in --runs, or the shipped one."""
    split: tuple[str, ...] = ()
    """The splits; by default all splits that rank methods."""
    rows: int = 200
    """How many settings of each split to play, from the first."""
    policies: flags.Policies = ()
    """Weights of policies to evaluate the model on too."""
    runs: flags.Runs = flags.RUNS
    threads: flags.Threads = 0
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
        evaluated: list[tuple[str, str, Evaluation]] = []
        for name in self.split or ranking_splits(self.reaches):
            whole = first(load_split(self.reaches, name), self.rows)
            for player, agent in players.items():
                played = whole if agent else evaluation.with_random_experts(whole)
                result = evaluation.evaluate(model, source, played, agent, self.threads)
                evaluated.append((name, player, result))
        rows = [{"split": name, "player": player, **result.as_dict()} for name, player, result in evaluated]
        if self.json:
            print_json(rows)
        elif self.markdown:
            _print_markdown(evaluated)
        else:
            columns = [column for column, value in rows[0].items() if not isinstance(value, list)]
            print_table("success model", columns, [[row[column] for column in columns] for row in rows])
        return DONE


def _print_markdown(rows: Sequence[tuple[str, str, Evaluation]]) -> None:
    """Prints what is evaluated, by split and player, in three tables.

    They are the scores, the AUC by time, and the calibration on the first split.
    """
    heads = ["success [%]", "accuracy [%]", "base-rate accuracy [%]", "Brier", "base-rate Brier", "calibration error"]
    scores = [[f"`{name}`", _agent(player), *_scores(result.overall)] for name, player, result in rows]
    print_markdown(["split", "agent", "transitions", *heads, "AUC"], scores)
    print()
    tenths = [f"{10 * k}-{10 * k + 10}" for k in range(10)]
    by_time = [[f"`{name}`", _agent(player), *_rounded(result.auc_by_time)] for name, player, result in rows]
    print_markdown(["split", "agent", *tenths, "after"], by_time)
    print()
    first = [(player, result.calibration[1]) for name, player, result in rows if name == rows[0][0]]
    bins = [f"{k / 10:.1f}-{(k + 1) / 10:.1f}" for k in range(10)]
    print_markdown(["agent", *bins], [[_agent(player), *_rounded(observed)] for player, observed in first])


def _agent(player: str) -> str:
    """The label of a player, which is a file of weights or EXPERTS."""
    from dextron_bench.storage import tensors

    return EXPERTS if player == EXPERTS else str(tensors.read_about(Path(player))["label"])


def _scores(overall: Metrics) -> list[str]:
    """The cells of scores."""
    shares = [100 * share for share in (overall.base_rate, overall.accuracy, overall.base_accuracy)]
    scores = [overall.brier, overall.base_brier, overall.calibration_error, overall.auc]
    return [f"{overall.rows:,}", *_rounded(shares, 1), *_rounded(scores, 3)]


def _rounded(values: Iterable[float], digits: int = 2) -> list[str]:
    """Cells of numbers; empty for NaN."""
    return ["" if math.isnan(value) else f"{value:.{digits}f}" for value in values]
