"""`dextron-bench runs show`: everything about a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dextron_bench.cli.support import flags, run_names
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json, print_table
from dextron_bench.cli.support.run_cells import INTERVALS, cell, code_of, interval_text, plain

if TYPE_CHECKING:
    from dextron_bench.catalogue.run_catalogue import Entry


@dataclass(frozen=True)
class Show:
    """Show everything about a run: settings, code, state, and scores on every split.

    Example: dextron-bench runs show rlil-0.1/real
    """

    run: flags.RunName
    runs: flags.Runs = flags.RUNS
    json: bool = False
    """Print JSON."""

    def __call__(self) -> int:
        entry = run_names.find(self.runs, self.run)
        about = {name: cell(entry, name, "test") for name in ("run", "state", "date", "tags", "note", "physics")}
        about |= {"folder": str(entry.folder), "seeds": list(entry.seeds), "code": code_of(entry)}
        about |= {"settings": dict(entry.settings), "command": _command(entry)}
        splits = [
            {"split": name, "seeds": len(scores), "rows": scores.shape[1]}
            | {what: entry.score(name, what) for what in ("return", "success")}
            for name, scores in entry.scores.items()
        ]
        if self.json:
            print_json(about | {"splits": splits})
            return DONE
        about["settings"] = ", ".join(f"{name} {value}" for name, value in entry.settings.items())
        print_table(entry.name, ["", ""], [[name, plain(value)] for name, value in about.items() if name != "run"])
        rows = [
            [name, *scores.shape, *(interval_text(entry, name, what) for what in INTERVALS)]
            for name, scores in entry.scores.items()
        ]
        print_table("scores", ["split", "seeds", "rows", *(f"{what} [95 %]" for what in INTERVALS)], rows)
        return DONE


def _command(entry: Entry) -> str:
    """The command that makes a run again, as far as its config says."""
    from dextron_bench.methods import registry

    settings = {name: value for name, value in entry.settings.items() if value is not None}
    try:
        flags = registry.as_flags(str(entry.code.get("class", entry.label)), settings)
    except registry.UnknownMethod:  # Its file lies elsewhere.
        words = [f"--method {entry.code.get('class')}", *(registry.as_flag(*one) for one in settings.items())]
        flags = " ".join(words)
    return f"dextron-bench run {flags} --reaches {entry.reaches} --seed {' '.join(map(str, entry.seeds))}"
