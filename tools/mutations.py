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
        ("dextron_bench/catalogue/expressions.py", "len(text) > LONGEST", "False"),
        ("dextron_bench/evaluation/diagnosis.py", "IN_TIME = 6 *", "IN_TIME = 60 *"),
        ("dextron_bench/evaluation/diagnosis.py", "FIST = 0.4 ", "FIST = 0.9 "),
        ("dextron_bench/evaluation/rollout.py", "np.flatnonzero(self._case >= 0)", "np.flatnonzero(self._case > 0)"),
        ("dextron_bench/evaluation/perturbation.py", "0.5 * noise.rotation", "noise.rotation"),
        ("dextron_bench/evaluation/perturbation.py", "self._step += 1", "self._step += 2"),
        ("dextron_bench/experts/openings.py", "is_near & (first_near[live] < 0)", "is_near"),
        ("dextron_bench/experts/policies.py", "critical) |", "critical) &"),
        ("dextron_bench/experts/policies.py", "actions[first_step] = 0.0", "actions[first_step] = 0.5"),
        ("dextron_bench/methods/exact.py", "STEPS = 2**24 ", "STEPS = 2**12 "),
        ("dextron_bench/methods/weights.py", "type(seed) is int and seed >= 0", "type(seed) is int"),
        ("dextron_bench/reaches/minjerk.py", "x + v * dt + a * dt**2 / 2.0", "x + v * dt + a * dt**2"),
        (
            "dextron_bench/reaches/reach.py",
            "TIME_SCALE * duration + TIME_SHIFT + TIME_SPREAD * noise",
            "TIME_SCALE * duration + TIME_SHIFT - TIME_SPREAD * noise",
        ),
        ("dextron_bench/reaches/rotation.py", "t = 2.0 * cross(axis, v)", "t = cross(axis, v)"),
        ("dextron_bench/runs/estimates.py", "len(split) - counts.get(split.name, 0)", "len(split)"),
        ("dextron_bench/scores/paired.py", "math.fsum(part.variance**2 / part.freedom for part in seeds)", "1"),
        ("dextron_bench/scores/paired.py", "FEW = 6 ", "FEW = 2 "),
        ("dextron_bench/scores/planning.py", "rest / scores.shape[1], 0.0", "rest, 0.0"),
        (
            "dextron_bench/scores/robustness.py",
            "(steps[-1] * CONTROL_STEP) / task.SUCCESS",
            "(steps[-1] * CONTROL_STEP)",
        ),
        ("dextron_bench/scores/standings.py", "ceiling - returns.mean()", "returns.mean() - ceiling"),
        ("dextron_bench/scores/statistics.py", "resamples.var() * seeds / (seeds - 1.0)", "resamples.var()"),
        ("dextron_bench/splits/hard.py", "(windows > 0) & (windows <= WINDOW)", "(windows <= WINDOW)"),
        ("dextron_bench/splits/near_equal.py", "< limits).all(axis=1)", "< limits).any(axis=1)"),
        ("dextron_bench/splits/scanning.py", "(np.arange(points) + 0.5) / points", "np.arange(points) / points"),
        ("dextron_bench/storage/shares.py", "place % self.of == self.index", "place % self.of >= self.index"),
        ("dextron_bench/storage/tensors.py", "end - begin != kind.itemsize * int(np.prod(shape))", "False"),
        ("dextron_bench/submissions/duplicates.py", "same > MANY * rows", "same > rows"),
        ("dextron_bench/submissions/replay_check.py", "bool(distance <= TOLERANCE)", "True"),
        (
            "dextron_bench/submissions/result_check.py",
            "abs(claimed - replayed) > RETURN_TOLERANCE",
            "claimed - replayed > RETURN_TOLERANCE",
        ),
        ("dextron_bench/submissions/result_check.py", "claimed.machine.cpu == here.machine.cpu and alike", "alike"),
        ("dextron_bench/success/dataset.py", "TEST_EVERY = 5 ", "TEST_EVERY = 4 "),
        ("dextron_bench/success/generation.py", "episode.score == task.SUCCESS", "episode.score > 0"),
        ("dextron_bench/success/metrics.py", "((chances - outcomes) ** 2).mean()", "np.abs(chances - outcomes).mean()"),
        ("dextron_bench/success/metrics.py", "wins * (wins + 1) / 2", "wins * (wins - 1) / 2"),
        ("dextron_bench/success/training.py", "// config.halved_every", "// 1000000"),
        ("dextron_bench/success/training.py", "halved_every: int = 100", "halved_every: int = 50"),
        ("dextron_bench/sweeps/space.py", "self.log and self.low <= 0", "self.log and self.low < 0"),
        ("dextron_bench/tracking/follower.py", "len(self._waiting) > self._pending", "False"),
        ("dextron_bench/training/checkpoints.py", "self.epoch >= self.epochs", "self.epoch > self.epochs"),
        ("dextron_bench/training/learning_curve.py", "sum(scores) / len(scores)", "max(scores)"),
        ("dextron_bench/world/engine.py", "self._progress.step[ids] + 1", "self._progress.step[ids]"),
        ("dextron_bench/world/task.py", "COUNTDOWN = 20 ", "COUNTDOWN = 19 "),
        ("dextron_bench/world/task.py", "bottle_height(states) >= LIFTED", "bottle_height(states) > LIFTED + 0.01"),
        ("dextron_bench/world/task.py", "bottle_height(states) < FALLEN", "bottle_height(states) < FALLEN - 0.01"),
        ("dextron_bench/world/task.py", "path_lengths - 1 + HOLD", "path_lengths + HOLD"),
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
