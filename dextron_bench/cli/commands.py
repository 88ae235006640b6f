"""The table of commands. A command is a frozen dataclass: its fields are the flags, its docstring is the help."""

from __future__ import annotations

from typing import Protocol

from dextron_bench.cli import (
    browse,
    check,
    compare,
    cross_validate,
    doctor,
    figures,
    mc,
    new_agent,
    plan,
    run,
    splits,
    submit,
    sweep,
    view,
    windows,
)
from dextron_bench.cli import eval as evaluation
from dextron_bench.cli import list as listing
from dextron_bench.cli.data import export, sources, synthetic
from dextron_bench.cli.leaderboard import fresh, tracks, verify
from dextron_bench.cli.leaderboard import show as leaderboard
from dextron_bench.cli.recordings import choose
from dextron_bench.cli.recordings import show as recordings
from dextron_bench.cli.runs import compare as runs_compare
from dextron_bench.cli.runs import edit
from dextron_bench.cli.runs import show as runs
from dextron_bench.cli.success import evaluation as success_eval
from dextron_bench.cli.success import model as success


class Command(Protocol):
    """Does its work when it is called, and returns the exit code."""

    def __call__(self) -> int: ...


Group = tuple[str, dict[str, type[Command]]]  # The description of a group of commands, and its commands.

COMMANDS: dict[str, type[Command] | Group] = {
    "run": run.Run,
    "eval": evaluation.Eval,
    "sweep": sweep.Sweep,
    "cross-validate": cross_validate.CrossValidate,
    "leaderboard": (
        "Leaderboards: show the results of a folder of runs; build, serve and verify the published leaderboard; "
        "add a submission to it; play fresh settings and tracks.",
        {
            **{"show": leaderboard.Show, "build": leaderboard.Build, "serve": leaderboard.Serve},
            **{"verify": verify.Verify, "add": verify.Add},
            **{"fresh": fresh.Fresh, "tracks": tracks.Tracks},
        },
    ),
    "new-agent": new_agent.NewAgent,
    "check": check.Check,
    "submit": submit.Submit,
    "compare": compare.Compare,
    "plan": plan.Plan,
    "view": view.View,
    "browse": browse.Browse,
    "recordings": (
        "Recordings: list them, export one as a film or a table, choose a few from the runs.",
        {"list": recordings.List, "export": recordings.Export, "choose": choose.Choose},
    ),
    "list": listing.List,
    "runs": (
        "Runs: list, show and compare them, find the best, mark them, put them away, export them.",
        {
            **{"list": runs.List, "show": runs.Show, "compare": runs_compare.Compare, "best": runs.Best},
            **{"tag": edit.Tag, "note": edit.Note, "archive": edit.Archive, "rm": edit.Remove},
            "export": edit.Export,
        },
    ),
    "data": (
        "Reaches: import or download the recorded ones, describe a source, fit and evaluate the synthetic ones; "
        "export episodes for offline learning.",
        {
            **{"import": sources.Import, "fetch": sources.Fetch, "info": sources.Info},
            "agreement": sources.Agreement,
            **{"fit": synthetic.Fit, "likeness": synthetic.Likeness, "export": export.Export},
        },
    ),
    "mc": mc.MonteCarlo,
    "splits": splits.Splits,
    "success": (
        "The success model: generate its data set, train it, evaluate it, explain episodes with it.",
        {
            **{"data": success.Data, "train": success.Train},
            **{"eval": success_eval.Eval, "explain": success_eval.Explain},
        },
    ),
    "figures": figures.Figures,
    "windows": windows.Windows,
    "doctor": doctor.Doctor,
}
