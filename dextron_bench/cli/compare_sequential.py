"""`dextron-bench compare --sequential`: plays two methods in a frozen random order until the difference is decided."""

from __future__ import annotations

from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from dextron_bench.cli.exit_codes import DIFFERS, DONE, EPISODES_FAILED
from dextron_bench.cli.output import print_json, print_table, progress_bar

if TYPE_CHECKING:
    import numpy as np

    from dextron_bench.cli.compare import Compare
    from dextron_bench.runs.in_order import ScoresInOrder
    from dextron_bench.scores.sequential import Decision
    from dextron_bench.splits.loading import Split
    from dextron_bench.storage.progress import Progress

INTERVAL = "B - A [95 % at any time]"


@dataclass(frozen=True)
class Outcome:
    """Scores (seeds, rows) of A and B on the rows that were needed, and what they decide."""

    a: np.ndarray
    b: np.ndarray
    score: Decision
    success: Decision


def compare(command: Compare, split: Split) -> int:
    """Compares A and B on a split; prints what was decided, after how many settings, and how many episodes it saved."""
    from dextron_bench.runs.contenders import open_scores

    with ExitStack() as stack:
        sides: list[ScoresInOrder] = []
        for name in (command.a, command.b):
            sides.append(open_scores(name, split, command.runs, command.seed, command.threads))
            stack.enter_context(closing(sides[-1]))
        with progress_bar(f"{sides[0].name} and {sides[1].name}", command.quiet) as report:
            outcome = _play(sides, len(split), report)
    _print_as_json(sides, outcome, split) if command.json else _print(sides, outcome, split)
    if any(side.failed for side in sides):
        return EPISODES_FAILED
    return DIFFERS if command.fail_if_worse and outcome.score.sign < 0 else DONE


def _play(sides: list[ScoresInOrder], rows: int, report: Progress) -> Outcome:
    """Plays one row after another, until the returns decide or all rows are played."""
    import numpy as np

    from dextron_bench.scores import sequential
    from dextron_bench.world import task

    a = b = returns = np.zeros((1, 0))
    for count in range(1, rows + 1):
        a, b = (side.first(count) for side in sides)
        returns = b.mean(axis=0) - a.mean(axis=0)
        after, _ = sequential.first_decision(returns / task.SUCCESS)
        report(count, rows)
        if after is not None:
            break
    solved_a, solved_b = (scores == task.SUCCESS for scores in (a, b))
    success = sequential.decide(solved_b.mean(axis=0) - solved_a.mean(axis=0), 1.0)
    return Outcome(a, b, sequential.decide(returns, task.SUCCESS), success)


def _saved(side: ScoresInOrder, split: Split) -> int:
    """Episodes that a full evaluation would have begun, and this one did not."""
    return 0 if side.is_stored else side.seeds * len(split) - side.begun


def _print_as_json(sides: list[ScoresInOrder], outcome: Outcome, split: Split) -> None:
    methods = {
        letter: {
            **{"name": side.name, "seeds": side.seeds, "stored": side.is_stored, "begun": side.begun},
            **{"saved": _saved(side, split), "failed": side.failed, "return": float(scores.mean())},
        }
        for letter, side, scores in zip("ab", sides, (outcome.a, outcome.b), strict=True)
    }
    about = {"reaches": split.reaches, "split": split.name, "digest": split.digest, "rows": len(split)}
    better = {1: "b", -1: "a", 0: None}[outcome.score.sign]
    decided = {"compared": outcome.a.shape[1], "better": better}
    print_json({**methods, **about, **decided, "return": asdict(outcome.score), "success": asdict(outcome.success)})


def _print(sides: list[ScoresInOrder], outcome: Outcome, split: Split) -> None:
    from dextron_bench.world import task

    title = f"A = {sides[0].name}, B = {sides[1].name}: {split.reaches} reaches, split {split.name}, version"
    solved = [100.0 * (scores == task.SUCCESS).mean() for scores in (outcome.a, outcome.b)]
    rows = [
        _row("return", (outcome.a.mean(), outcome.b.mean()), outcome.score, 1.0),
        _row("success %", (solved[0], solved[1]), outcome.success, 100.0),
    ]
    columns = ["", "A", "B", INTERVAL, "capital", "decided after"]
    print_table(f"{title} {split.digest[:8]}, {outcome.a.shape[1]} of {len(split)} rows", columns, rows)
    words = {1: "B scores more", -1: "A scores more", 0: "undecided: the difference may be 0"}
    print(f"{words[outcome.score.sign]}; compared on {outcome.a.shape[1]} of {len(split)} settings")
    for letter, side in zip("AB", sides, strict=True):
        print(f"{letter}: {_effort(side, split)}")


def _row(name: str, means: tuple[float, float], decision: Decision, unit: float) -> list[str]:
    from dextron_bench.scores.sequential import ENOUGH

    mean = means[1] - means[0]
    ends = f"{mean:+.2f} [{unit * decision.low:+.2f}, {unit * decision.high:+.2f}]"
    after = "" if decision.after is None else str(decision.after)
    return [name, *(f"{one:.2f}" for one in means), ends, f"{decision.capital:.3g} of {ENOUGH:g}", after]


def _effort(side: ScoresInOrder, split: Split) -> str:
    """How many episodes a method began, and how many that saved."""
    from dextron_bench.scores import cells

    seeds = cells.counted(side.seeds, "seed")
    if side.is_stored:
        return f"stored results of {seeds}, nothing was played"
    failed = f"; {side.failed} failed" if side.failed else ""
    total = side.seeds * len(split)
    return f"{side.begun} of {total} episodes begun ({seeds}), {_saved(side, split)} saved{failed}"
