"""`dextron-bench sweep cross-validate`: trains a method without each subject in turn, and evaluates it on that one."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE, EPISODES_FAILED
from dextron_bench.cli.support.method_flags import settings_dict
from dextron_bench.cli.support.output import print_json, print_markdown, print_table, progress_bar

if TYPE_CHECKING:
    import numpy as np

    from dextron_bench.scores.statistics import Estimate
    from dextron_bench.sweeps.cross_validation import LeftOut

ALL = "all"


@dataclass(frozen=True)
class CrossValidate:
    """Train a method without each subject of `train` in turn, and evaluate it on that subject's settings of `train`.

    The snapshot of a training is chosen on the rows of `val` of the other subjects. No other split is played. The
    settings of the method are flags, as for `run`. The same command continues after an interruption.

    Example: dextron-bench sweep cross-validate --method stopping --reaches real --seed 0 1 2
    """

    method: flags.Method
    beside: tuple[str, ...] = ("reflex",)
    """Methods with their default settings, for further columns; those that do not learn play with the first seed."""
    seed: tuple[int, ...] = (0,)
    """Seeds of the agent."""
    reaches: flags.Reaches = "synthetic"
    runs: Path = Path("runs")
    """Folder of all runs; the runs without a subject are below its folder `without`."""
    threads: flags.Threads = 0
    device: flags.Device = "cpu"
    quiet: flags.Quiet = False
    markdown: bool = False
    """Print the table as Markdown, for a document."""
    json: bool = False
    """Print the table as JSON, with the mean returns."""
    method_settings: tyro.conf.Suppress[Any] = None

    def __call__(self) -> int:
        from dextron_bench.runs.plans import Plan, resolve

        seeds = tuple(dict.fromkeys(self.seed))
        plans = [Plan(self.method, self.reaches, settings=settings_dict(self.method_settings))]
        plans += [Plan(name, self.reaches) for name in self.beside]
        runs = {run.label: run for run in map(resolve, plans)}
        table = {
            label: self._play(run.plan, seeds if number == 0 or run.learner else seeds[:1])
            for number, (label, run) in enumerate(runs.items())
        }
        self._print(table, seeds)
        return EPISODES_FAILED if any(part.failed for parts in table.values() for part in parts) else DONE

    def _play(self, plan: Any, seeds: tuple[int, ...]) -> list[LeftOut]:
        from dextron_bench.sweeps import cross_validation
        from dextron_bench.sweeps.execution import Resources

        resources = Resources(self.runs, self.threads, self.device, lambda title: progress_bar(title, self.quiet))
        return list(cross_validation.cross_validate(plan, seeds, resources))

    def _print(self, table: dict[str, list[LeftOut]], seeds: tuple[int, ...]) -> None:
        """Prints a row for each subject, and one for all settings."""
        import numpy as np

        by_subject = {
            **{part.subject: [parts[row].scores for parts in table.values()] for row, part in enumerate(_first(table))},
            ALL: [np.concatenate([part.scores for part in parts], axis=1) for parts in table.values()],
        }
        rows = [(subject, scores[0].shape[1], list(map(_estimates, scores))) for subject, scores in by_subject.items()]
        if self.json:
            print_json(
                [
                    {
                        **{"subject": subject, "settings": count},
                        "methods": {
                            label: {"return": asdict(returns), "success": asdict(successes)}
                            for label, (returns, successes) in zip(table, estimates, strict=True)
                        },
                    }
                    for subject, count, estimates in rows
                ]
            )
            return
        columns = ["subject", "settings", *(f"{label}, success % [95 %]" for label in table)]
        cells = [
            [subject, str(count), *(_percent(successes) for _, successes in estimates)]
            for subject, count, estimates in rows
        ]
        names = " ".join(map(str, seeds))
        title = f"subjects of train of {self.reaches} reaches, each left out in turn; seeds {names}"
        print_markdown(columns, cells) if self.markdown else print_table(title, columns, cells)


def _first(table: dict[str, list[LeftOut]]) -> list[LeftOut]:
    return next(iter(table.values()))


def _estimates(scores: np.ndarray) -> tuple[Estimate, Estimate]:
    """Mean return and success rate of scores (seeds, settings)."""
    from dextron_bench.scores import statistics
    from dextron_bench.world import task

    solved = (scores == task.SUCCESS).astype(float)
    return statistics.estimate(scores), statistics.estimate(solved, statistics.SHARES)


def _percent(share: Estimate) -> str:
    return f"{100 * share.mean:.1f} [{100 * share.low:.1f}, {100 * share.high:.1f}]"
