"""Makes small faults in a copy of the code, one at a time, and lists those that no fast test notices (CONTRIBUTING.md).

python -m tools.mutations             # all, in about an hour of processor time
python -m tools.mutations statistics  # those in files whose path has this text
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
COPIED = ("baselines", "dextron_bench", "docs", "examples", "leaderboard", "recordings", "tests", "tools")
PASSED, FAILED = 0, 1  # Exit codes of pytest.


class Mutation(NamedTuple):
    """A fault: `old` stands once in `file`, a path below the checkout, and becomes `new`."""

    file: str
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.file}: {self.old} -> {self.new}"


MUTATIONS = tuple(
    Mutation(*words)
    for words in (
        ("baselines/bc.py", "// HALVED_EVERY", "// 1000000"),
        ("baselines/bc.py", "HALVED_EVERY = 100 ", "HALVED_EVERY = 50 "),
        ("baselines/cycle.py", "after, step.terminated)", "after, step.ended)"),
        ("baselines/cycle.py", "rewards / self._rewards.deviation", "rewards"),
        ("baselines/rlil.py", "int(self.dur", "round(self.dur"),
        ("baselines/schedule.py", "epochs=1000, warm_start=10_000", "epochs=1000, warm_start=5_000"),
        ("dextron_bench/scores/paired.py", "math.fsum(part.variance**2 / part.freedom for part in seeds)", "1"),
        ("dextron_bench/scores/statistics.py", "resamples.var() * seeds / (seeds - 1.0)", "resamples.var()"),
        ("dextron_bench/success/generation.py", "episode.score == task.SUCCESS", "episode.score > 0"),
        ("dextron_bench/success/training.py", "// config.halved_every", "// 1000000"),
        ("dextron_bench/success/training.py", "halved_every: int = 100", "halved_every: int = 50"),
    )
)


def tests_of(file: str) -> list[str]:
    """The tests of a file, then those of its package."""
    package = Path(file.removeprefix("dextron_bench/")).parent.as_posix()
    folder = "tests" if package == "." else f"tests/{package}"
    module = f"{folder}/test_{Path(file).stem}.py"
    return [module, folder] if (ROOT / module).exists() else [folder]


def survives(mutation: Mutation, tree: Path) -> bool:
    """True if the tests of the package pass with the fault; the tree is left as it was.

    Raises ValueError if the text to replace does not stand once in the file, and if tests could not run.
    """
    file = tree / mutation.file
    text = file.read_text()
    if text.count(mutation.old) != 1:
        raise ValueError(f"{mutation.file} has {mutation.old!r} {text.count(mutation.old)} times: mend the table")
    file.write_text(text.replace(mutation.old, mutation.new))
    try:
        return all(passes(tests, tree) for tests in tests_of(mutation.file))
    finally:
        file.write_text(text)


def passes(tests: str, tree: Path) -> bool:
    """True if the fast tests of a file or folder pass."""
    options = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", tests]
    command = [sys.executable, "-m", "pytest", *options]
    ended = subprocess.run(command, cwd=tree, env=None, capture_output=True, text=True)
    if ended.returncode not in (PASSED, FAILED):
        raise ValueError(f"{tests} did not run: {(ended.stdout + ended.stderr)[-500:]}")
    return ended.returncode == PASSED


def copy_tree(place: Path) -> Path:
    """A copy of what the tests read."""
    for name in COPIED:
        shutil.copytree(ROOT / name, place / name, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ROOT.iterdir():
        if file.is_file():
            shutil.copy(file, place)
    return place


def survivors(mutations: Iterable[Mutation]) -> list[Mutation]:
    """Those that no test notices."""
    found = []
    with tempfile.TemporaryDirectory(prefix="dextron-mutations-") as folder:
        tree = copy_tree(Path(folder))
        for mutation in mutations:
            survived = survives(mutation, tree)
            print(f"{'survives' if survived else 'noticed '}  {mutation}", flush=True)
            found += [mutation] * survived
    return found


def main(words: Sequence[str]) -> int:
    """Exit code 1 if a fault survives."""
    chosen = [mutation for mutation in MUTATIONS if all(word in mutation.file for word in words)]
    left = survivors(chosen)
    print(f"{len(left)} of {len(chosen)} faults survive")
    return 1 if left or not chosen else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
