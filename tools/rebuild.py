"""`make rebuild`: rebuilds everything that depends on the physics, and knows what is stale."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import tyro

from dextron_bench.cli.support.exit_codes import DONE, USAGE
from dextron_bench.cli.support.output import print_table
from dextron_bench.processes import programs
from tools.rebuild_steps import STEPS, Step

LEDGER = Path("leaderboard/rebuilt")  # A file for each step: hashes of what it read and of what it made.
DOCUMENTS = ("README.md", "docs/*.md", "recordings/README.md")  # Their numbers come from data.


class NoCheckout(FileNotFoundError):
    """The present folder is not a checkout of the project."""


class UnknownStep(LookupError):
    """A name that no step has."""


class StepFailed(RuntimeError):
    """A command of a step ended with an error."""


@dataclass(frozen=True)
class Rebuild:
    """Rebuild what depends on the physics: databases, splits, trainings, success models, recordings, board, documents.

    Run it in a checkout. A step is stale if the physics, its commands, the files that it reads or the files that it
    made have changed since. Only stale steps run. If it is interrupted, the same command continues where it stopped.
    Two commands may run different steps at the same time.

    Example: python -m tools.rebuild --list
    """

    step: tuple[str, ...] = ()
    """Steps to run if they are stale; by default all, in order."""
    list: bool = False
    """Only print the steps, and which of them are stale."""
    runs: Path = Path("runs")
    """Folder of all runs, in which searches and trainings continue."""

    def __call__(self) -> int:
        steps = _chosen(self.step)
        if not (Path("leaderboard").is_dir() and Path("dextron_bench/data").is_dir()):
            raise NoCheckout("rebuild needs a checkout of the project as the present folder")
        if self.list:
            print_table("steps", ["step", "state"], [(step.name, _state(step)) for step in steps])
            return DONE
        for step in steps:
            if _state(step) != "fresh":
                print(f"rebuild: {step.name}", flush=True)
                self._run(step)
        return self._fill_documents()

    def _run(self, step: Step) -> None:
        from dextron_bench.storage import atomic

        read = _inputs(step)
        for command in step.commands:
            words = [path for word in shlex.split(command.format(runs=self.runs)) for path in _expanded(word)]
            code = subprocess.run(programs.python("-m", "dextron_bench", *words), check=False).returncode
            if code:
                raise StepFailed(f"{step.name}: `dextron-bench {' '.join(words)}` ended with code {code}; run it again")
        for source, place in step.copies:
            atomic.write_atomically(Path(place), partial(shutil.copyfile, self.runs / source))
        if step.publishes:
            from dextron_bench.leaderboard import collect

            collect.take(self.runs, Path("leaderboard"), step.publishes)
        atomic.write_json(_entry_file(step), {"inputs": read, "outputs": _outputs(step)})

    def _fill_documents(self) -> int:
        from dextron_bench.storage.folders import visible
        from tools import documents

        files = [file for pattern in DOCUMENTS for file in visible(Path(), pattern)]
        for file in documents.fill(files, Path("leaderboard")):
            print(f"rebuild: numbers in {file}")
        return DONE


def _chosen(names: Iterable[str]) -> list[Step]:
    known = {step.name: step for step in STEPS}
    if unknown := [name for name in names if name not in known]:
        raise UnknownStep(f"no step {unknown[0]!r}; choose from {', '.join(known)}")
    return [step for step in STEPS if not names or step.name in names]


def _state(step: Step) -> str:
    """`fresh`, `stale`, or `missing` if the step was never done here."""
    from dextron_bench.storage import records

    if not _entry_file(step).exists():
        return "missing"
    return (
        "fresh"
        if records.read(_entry_file(step), dict[str, str | dict[str, str]])
        == {"inputs": _inputs(step), "outputs": _outputs(step)}
        else "stale"
    )


def _inputs(step: Step) -> str:
    """The hash of the physics, of the step's commands and of the files that it reads."""
    from dextron_bench.storage import hashing
    from dextron_bench.world import model

    files = "".join(f"{path} {digest}\n" for path, digest in _hashes(step.needs).items())
    return hashing.digest(model.mjcf_hash().encode(), "\n".join(step.commands).encode(), files.encode())


def _outputs(step: Step) -> dict[str, str]:
    """The hashes of the files that a step makes, by path; of published results, without what verifications add."""
    from dextron_bench.leaderboard import collect

    weights = [f"baselines/weights/{name}/*" for name in step.publishes]
    curves = [f"leaderboard/results/{name}/*/curve.json" for name in step.publishes]
    results = [f"leaderboard/results/{name}/*/result.json" for name in step.publishes]
    copied = [place for _, place in step.copies]
    return _hashes((*step.makes, *copied, *weights, *curves)) | _hashes(results, collect.run_digest)


def _hashes(patterns: Iterable[str], digest: Callable[[Path], str] | None = None) -> dict[str, str]:
    """The hashes of files, by path: of their bytes, or what `digest` returns."""
    from dextron_bench.storage import hashing
    from dextron_bench.storage.folders import visible

    digest = digest or hashing.sha256
    files = {file for pattern in patterns for file in visible(Path(), pattern) if file.is_file()}
    return {file.as_posix(): digest(file) for file in sorted(files)}


def _expanded(word: str) -> Iterator[str]:
    """The files that a pattern names; any other word unchanged."""
    from dextron_bench.storage.folders import visible

    yield from (map(str, visible(Path(), word)) if "*" in word else [word])


def _entry_file(step: Step) -> Path:
    return LEDGER / f"{step.name}.json"


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code; `arguments` default to `sys.argv`."""
    try:
        return tyro.cli(Rebuild, prog="rebuild", args=arguments)()
    except (NoCheckout, UnknownStep, StepFailed) as error:
        print(f"rebuild: {error}", file=sys.stderr)
        return USAGE


if __name__ == "__main__":
    sys.exit(main())
