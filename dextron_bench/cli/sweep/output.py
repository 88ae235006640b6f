"""A sweep as a person reads it: a line for each trial, a table, and the winner."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dextron_bench.cli.support.output import print_table

if TYPE_CHECKING:
    from dextron_bench.sweeps.sweep import SweepFile
    from dextron_bench.sweeps.trial import Trial


def in_words(trial: Trial) -> str:
    """The settings and the outcome of a trial in one line."""
    settings = ", ".join(f"{name} {value}" for name, value in trial.settings.items())
    outcome = f"return {_interval(trial)} on val, success {_percent(trial)} %" if trial.returns else _state(trial)
    return f"{settings}: {outcome}"


def print_trials(file: SweepFile, content: Mapping[str, Any], trials: list[Trial], runs: Path) -> None:
    """Prints the table of trials, the best first."""
    names = list(content["question"]["space"])
    ranked = sorted(trials, key=lambda trial: -trial.score if trial.returns else 1.0)
    rows = [
        [
            *(str(trial.settings[name]) for name in names),
            *(trial.run, _interval(trial), _percent(trial), _running(trial, runs) or _state(trial)),
        ]
        for trial in ranked
    ]
    seeds = " ".join(map(str, content["question"]["seeds"]))
    columns = [*names, "run", "return on val [95 %]", "success %", "state"]
    print_table(f"{file.path}, seeds {seeds}", columns, rows)


def print_winner(content: Mapping[str, Any], trials: list[Trial], runs: Path) -> None:
    """Prints the winner, how it was chosen, and the command that plays it on the splits that rank."""
    from dextron_bench.methods import registry
    from dextron_bench.sweeps.trial import STARTED

    if content["winner"] is None:
        print("no trial is done, so there is no winner")
        return
    winner, question = trials[content["winner"]["trial"]], content["question"]
    words = [content["flags"], *(registry.as_flag(name, value) for name, value in winner.settings.items())]
    words += ["--reaches", question["reaches"], "--seed", *map(str, question["seeds"])]
    words += [] if runs == Path("runs") else ["--runs", str(runs)]
    title = "best so far" if any(trial.state == STARTED for trial in trials) else "winner"
    print(f"{title}: {winner.run}, with {in_words(winner)}\n{content['choice']}")
    print(f"On the splits that rank: dextron-bench run {' '.join(words)}")


def draw(content: Mapping[str, Any], trials: list[Trial], file: Path) -> None:
    """Draws the scores of the trials that are done against the only setting that varies; raises OSError."""
    from dextron_bench.scores.figures import sweeps

    question, (setting,) = content["question"], content["question"]["space"]
    points = [
        sweeps.Point(float(trial.settings[setting]), trial.returns, trial.successes)
        for trial in trials
        if trial.returns and trial.successes
    ]
    seeds = " ".join(map(str, question["seeds"]))
    title = f"{question['method']} on val of {question['reaches']} reaches, seeds {seeds}"
    file.parent.mkdir(parents=True, exist_ok=True)
    sweeps.scaling(points, setting, title, file)


def _state(trial: Trial) -> str:
    """The state of a trial, with its error, and the number of episodes in which the agent raised one."""
    from dextron_bench.scores import cells
    from dextron_bench.sweeps.trial import STOPPED

    state = f"{trial.state} at epoch {max(trial.points)}" if trial.state == STOPPED else trial.state
    state += f" ({cells.counted(trial.failed, 'episode')} failed)" if trial.failed else ""
    return f"{state}: {trial.error}" if trial.error else state


def _running(trial: Trial, runs: Path) -> str:
    """How far the training is of a trial that was started and has not ended; empty if it has none."""
    from dextron_bench.sweeps.trial import STARTED
    from dextron_bench.training import jobs

    for training in jobs.unfinished(runs) if trial.state == STARTED else ():
        if trial.run == f"{training.label}/{training.reaches}":
            return f"{'training' if training.is_running else 'interrupted'}, {training.left} left"
    return ""


def _interval(trial: Trial) -> str:
    score = trial.returns
    return f"{score.mean:.2f} [{score.low:.2f}, {score.high:.2f}]" if score else ""


def _percent(trial: Trial) -> str:
    return f"{100 * trial.successes.mean:.1f}" if trial.successes else ""
