"""`dextron-bench success eval`: evaluates the success model on new episodes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_markdown, print_table
from dextron_bench.cli.support.rows import first
from dextron_bench.cli.support.success_models import load_model

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


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
        rows = []
        for name in self.split or ranking_splits(self.reaches):
            whole = first(load_split(self.reaches, name), self.rows)
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
