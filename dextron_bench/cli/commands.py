"""The table of commands. A command is a frozen dataclass: its fields are the flags, its docstring is the help."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from dextron_bench.cli import browse, check, doctor, figures, new_agent, run, submit, view, windows
from dextron_bench.cli import eval as evaluation
from dextron_bench.cli.compare import compare, plan
from dextron_bench.cli.data import agreement, info, likeness, mc, recorded, splits
from dextron_bench.cli.data import export as data_export
from dextron_bench.cli.leaderboard import add, announce, build, round, serve, show, tracks, verify
from dextron_bench.cli.recordings import choose
from dextron_bench.cli.recordings import export as recordings_export
from dextron_bench.cli.recordings import list as recordings_list
from dextron_bench.cli.runs import archive, best, methods, note, rm, tag
from dextron_bench.cli.runs import compare as runs_compare
from dextron_bench.cli.runs import export as runs_export
from dextron_bench.cli.runs import list as runs_list
from dextron_bench.cli.runs import show as runs_show
from dextron_bench.cli.success import data as success_data
from dextron_bench.cli.success import eval as success_eval
from dextron_bench.cli.success import explain, train
from dextron_bench.cli.sweep import cross_validate, sweep


class Command(Protocol):
    """Does its work when it is called, and returns the exit code."""

    def __call__(self) -> int: ...


@dataclass(frozen=True, slots=True)
class Group:
    """Commands with a first word in common; `command` is what this word alone does, if it does anything."""

    description: str
    members: Mapping[str, type[Command]]
    command: type[Command] | None = None


Commands = Mapping[str, type[Command] | Group]

RUNS = Group(
    "Runs: list, show and compare them, find the best, mark them, put them away, export them; methods to run.",
    {
        "list": runs_list.List,
        "show": runs_show.Show,
        "compare": runs_compare.Compare,
        "best": best.Best,
        "tag": tag.Tag,
        "note": note.Note,
        "archive": archive.Archive,
        "rm": rm.Remove,
        "export": runs_export.Export,
        "methods": methods.Methods,
    },
)
LEADERBOARD = Group(
    "Leaderboards: show the results of a folder of runs; build, serve and verify the published leaderboard; "
    "add a submission to it; play rounds and tracks.",
    {
        "show": show.Show,
        "build": build.Build,
        "serve": serve.Serve,
        "verify": verify.Verify,
        "add": add.Add,
        "announce": announce.Announce,
        "round": round.Round,
        "tracks": tracks.Tracks,
    },
)
DATA = Group(
    "Reaches: import or download the recorded ones, describe a source, evaluate the synthetic ones. Experts and "
    "splits: search, build, list. Episodes: export them for offline learning.",
    {
        "import": recorded.Import,
        "fetch": recorded.Fetch,
        "info": info.Info,
        "agreement": agreement.Agreement,
        "likeness": likeness.Likeness,
        "mc": mc.MonteCarlo,
        "splits": splits.Splits,
        "export": data_export.Export,
    },
)
SECTIONS: dict[str, Commands] = {  # By heading of the help.
    "train and play": {
        "run": run.Run,
        "eval": evaluation.Eval,
        "sweep": Group("", {"cross-validate": cross_validate.CrossValidate}, sweep.Sweep),
    },
    "look": {
        "runs": RUNS,
        "view": view.View,
        "browse": browse.Browse,
        "recordings": Group(
            "Recordings: list them, export one as a film or a table, choose a few from the runs.",
            {"list": recordings_list.List, "export": recordings_export.Export, "choose": choose.Choose},
        ),
        "windows": windows.Windows,
    },
    "compare and submit": {
        "compare": Group("", {"plan": plan.Plan}, compare.Compare),
        "leaderboard": LEADERBOARD,
        "new-agent": new_agent.NewAgent,
        "check": check.Check,
        "submit": submit.Submit,
    },
    "data": {
        "data": DATA,
        "success": Group(
            "The success model: generate its data set, train it, evaluate it, explain episodes with it.",
            {
                "data": success_data.Data,
                "train": train.Train,
                "eval": success_eval.Eval,
                "explain": explain.Explain,
            },
        ),
    },
    "build": {"figures": figures.Figures, "doctor": doctor.Doctor},
}
COMMANDS: Commands = {name: command for section in SECTIONS.values() for name, command in section.items()}

MOVED = {  # By old name: the new one.
    "list": "`runs list`, and for methods and splits `runs methods` and `data splits`",
    "plan": "`compare plan`",
    "cross-validate": "`sweep cross-validate`",
    "mc": "`data mc`",
    "leaderboard fresh": "`leaderboard round`, for all rows together",
    "splits": "`data splits`",
    "data fit": "`python -m tools.fit_synthetic`, in a checkout",
    "rebuild": "`make rebuild`, in a checkout",
}
MOVED_FLAGS = {  # By command and old flag: the new one.
    ("leaderboard build", "--into"): "--board",
    ("leaderboard serve", "--into"): "--board",
    ("figures", "--results"): "--board, the folder that holds `results`",
    ("data info", "--picture"): "--into",
    ("data export", "--weights"): "--policies",
    ("submit", "--settings"): "a flag for each setting, as in --near 0.05",
    ("check", "--settings"): "a flag for each setting, as in --near 0.05",
}


def find(words: Sequence[str]) -> tuple[list[str], type[Command] | Group | None, list[str]]:
    """The names at the start of `words`, the command or group that they name, and the rest; None without any."""
    names: list[str] = []
    place: type[Command] | Group | None = None
    table: Commands = COMMANDS
    while len(names) < len(words) and (word := words[len(names)]) in table:
        names.append(word)
        place = table[word]
        table = place.members if isinstance(place, Group) else {}
    rest = list(words[len(names) :])
    return names, place.command or place if isinstance(place, Group) else place, rest
