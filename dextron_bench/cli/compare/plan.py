"""`dextron-bench compare plan`: how many settings and seeds show a difference between two methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Literal

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table
from dextron_bench.reaches.sources import SourceName

TOO_MANY = "more seeds are needed"


class BadPlan(ValueError):
    """A difference or a number of seeds that no plan can have."""


@dataclass(frozen=True)
class Plan:
    """Plan a comparison: how many settings and seeds show a difference of 2 % in success, four times in five.

    The noise comes from results of two methods like those that will be compared; docs/statistics.md has the formula.

    Example: dextron-bench compare plan bc rlil-0.1 --reaches real

    Example: dextron-bench compare plan reflex runs/mine/synthetic --measure return --difference 0.5 --seeds 3 6
    """

    a: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="A")]
    """A method with results: a label or a path, as for `compare`."""
    b: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="B")]
    """Another method with results on the same settings."""
    difference: float = 2.0
    """The difference to show: in % of success, or in return of 20 with --measure return."""
    measure: Literal["success", "return"] = "success"
    """What is compared."""
    seeds: tuple[int, ...] = (3, 5, 10, 20)
    """The numbers of seeds to plan for; a method with one seed in its results keeps one."""
    split: str = "test"
    """The split that both played."""
    reaches: SourceName | None = None
    """The source of reaches; needed only if both have results on several."""
    runs: flags.Runs = flags.RUNS
    json: bool = False
    """Print JSON."""

    def __call__(self) -> int:
        from dextron_bench.runs import result_files
        from dextron_bench.scores import cells, comparison, paired, planning
        from dextron_bench.world import task

        if self.difference <= 0.0 or min(self.seeds) < 2:
            raise BadPlan("--difference must be above 0, and --seeds at least 2: one seed does not show their spread")
        results = [result_files.find(name, self.runs, self.split) for name in (self.a, self.b)]
        a, b = comparison.align((self.a, self.b), (results[0], results[1]), self.split, self.reaches)
        one, other = (100.0 * (x.scores == task.SUCCESS) if self.measure == "success" else x.scores for x in (a, b))
        noise = planning.noise(one, other)
        plans = planning.plans(noise, self.difference, self.seeds)
        present = paired.difference(one, other).detectable
        if self.json:
            print_json({"noise": asdict(noise), "present": present, "plans": [asdict(plan) for plan in plans]})
            return DONE
        unit = "% in success" if self.measure == "success" else "in return"
        title = f"to show a difference of {self.difference:g} {unit} between {a.name} and {b.name}"
        rows = [[plan.seeds, *(TOO_MANY if n is None else n for n in (plan.settings, plan.episodes))] for plan in plans]
        print_table(f"{title}, {a.split} of {a.reaches} reaches", ["seeds", "settings", "episodes"], rows)
        counts = f"{cells.counted(len(a.scores), 'seed')} of {a.name} and {len(b.scores)} of {b.name}"
        print(f"made from {counts} on {a.scores.shape[1]} settings, which show {present:.2f} {unit}")
        print(f"standard deviation between settings {noise.settings**0.5:.2f}, between seeds {_listed(noise.seeds)}")
        return DONE


def _listed(variances: Sequence[float]) -> str:
    """Standard deviations as text."""
    return " and ".join(f"{variance**0.5:.2f}" for variance in variances) or "unknown: no method has several seeds"
