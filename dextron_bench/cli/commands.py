"""The table of commands. A command is a frozen dataclass: its fields are the flags, its docstring is the help."""

from __future__ import annotations

from typing import Protocol

from dextron_bench.cli import (
    browse,
    check,
    compare,
    cross_validate,
    data,
    data_export,
    data_synthetic,
    doctor,
    figures,
    leaderboard,
    leaderboard_fresh,
    leaderboard_tracks,
    leaderboard_verify,
    mc,
    new_agent,
    plan,
    rebuild,
    recordings,
    recordings_choose,
    run,
    runs,
    runs_compare,
    runs_edit,
    splits,
    submit,
    success,
    success_eval,
    sweep,
    view,
    windows,
)
from dextron_bench.cli import eval as evaluation
from dextron_bench.cli import list as listing


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
            **{"verify": leaderboard_verify.Verify, "add": leaderboard_verify.Add},
            **{"fresh": leaderboard_fresh.Fresh, "tracks": leaderboard_tracks.Tracks},
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
        {"list": recordings.List, "export": recordings.Export, "choose": recordings_choose.Choose},
    ),
    "list": listing.List,
    "runs": (
        "Runs: list, show and compare them, find the best, mark them, put them away, export them.",
        {
            **{"list": runs.List, "show": runs.Show, "compare": runs_compare.Compare, "best": runs.Best},
            **{"tag": runs_edit.Tag, "note": runs_edit.Note, "archive": runs_edit.Archive, "rm": runs_edit.Remove},
            "export": runs_edit.Export,
        },
    ),
    "data": (
        "Reaches: import or download the recorded ones, describe a source, fit and evaluate the synthetic ones; "
        "export episodes for offline learning.",
        {
            **{"import": data.Import, "fetch": data.Fetch, "info": data.Info, "agreement": data.Agreement},
            **{"fit": data_synthetic.Fit, "likeness": data_synthetic.Likeness, "export": data_export.Export},
        },
    ),
    "mc": mc.MonteCarlo,
    "splits": splits.Splits,
    "success": (
        "The success model: generate its data set, train it, evaluate it, explain episodes with it.",
        {"data": success.Data, "train": success.Train, "eval": success_eval.Eval, "explain": success_eval.Explain},
    ),
    "figures": figures.Figures,
    "windows": windows.Windows,
    "rebuild": rebuild.Rebuild,
    "doctor": doctor.Doctor,
}
