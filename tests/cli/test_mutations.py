"""Mutations of every kind of file: no code 70, no hang, no gigabyte of memory, no result that changes without a word.

Each mutation is made in a copy of a finished run, an unfinished training, a search, a board, a submission or a
recording; then the command that reads the file runs again. Either it ends with one line and code 2 (1 for a refused
submission), or all files that it makes have the bytes of before. `pytest --thorough` makes 300 mutations of each file.
"""

from __future__ import annotations

import json
import random
import resource
import shutil
import signal
import types
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.experts.montecarlo import Search
from dextron_bench.experts.search_work import SearchWork
from dextron_bench.methods import weights
from dextron_bench.training import learning_curve
from dextron_bench.world.engine import Engine
from tests.helpers import tiny_benchmark, tiny_training
from tests.helpers.forged_bundles import AGENT
from tests.helpers.short_reaches import SOURCE
from tests.helpers.toy_learner import ToyTrainer

COUNT, THOROUGH = 7, 300  # Mutations of each kind of file.
LONGEST = 30  # [s] that a command may take.
MOST_MEMORY = 2**30  # Bytes; the memory of this process, and of all that it starts, may grow by so much.
TOY = ["--method", "tests.helpers.toy_learner:Toy", "--preset", "quick", "--quiet", "--record", "0"]
RUN = ["run", *TOY]
BUILD = ["leaderboard", "build", "--runs", "runs", "--board", "board"]
BASE = "runs/toy-0.1/synthetic"
BUNDLE, RECORDING = "near-synthetic.zip", "runs/nothing/synthetic/seed0/recordings/test-0000.rrd"
STRANGE: list[Any] = [None, "", "text", -1, 1e308, 10**30, float("nan"), True, [], {}, [[]], {"a": None}]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Path]]:
    """A finished run with its board, an unfinished training, a search, a submission and a recording."""
    root = tmp_path_factory.mktemp("mutations")
    with pytest.MonkeyPatch.context() as patch:
        tiny_training.install(tiny_training.write(root / "data"), patch.setattr)
        patch.setattr(weights, "shipped_folder", lambda learner, reaches: root / "shipped" / learner.label / reaches)
        patch.setattr(learning_curve, "rollout", tiny_training.artificial_scores)
        made = {name: root / name for name in ("finished", "unfinished", "search", "submission", "recording")}
        for folder in made.values():
            folder.mkdir()
        patch.chdir(made["finished"])
        assert main.main(RUN) == main.main(BUILD) == 0
        patch.chdir(made["unfinished"])
        with patch.context() as broken:
            broken.setattr(ToyTrainer, "advance", advance_until_the_fifth)
            assert main.main(RUN) == 2
        SearchWork(SEARCH, made["search"], 1, SOURCE, Engine(12, 1)).run()
        patch.chdir(made["submission"])
        Path("near.py").write_text(AGENT)
        assert main.main(["submit", "near.py:Near", "--name", "near", "--seed", "0", "--quiet"]) == 0
        patch.chdir(made["recording"])
        assert main.main(["run", "--method", "nothing", "--quiet", "--record", "1"]) == 0
        yield made
    tiny_benchmark.forget()


SEARCH = Search("brief", seed=3, experts=3, block=4)
real_advance = ToyTrainer.advance


def advance_until_the_fifth(trainer: ToyTrainer) -> list[dict[str, float]]:
    if trainer.epoch == 4:
        raise ZeroDivisionError("stopped")
    return real_advance(trainer)


def run() -> int:
    return main.main(RUN)


def build() -> int:
    return main.main(BUILD)


def search() -> int:
    try:
        draws = SearchWork(SEARCH, Path(), 1, SOURCE, Engine(12, 1)).run()
    except Exception as error:
        return main.explain(error)[0]
    draws.to_csv("draws.csv")
    return 0


def verify() -> int:
    return main.main(["leaderboard", "verify", BUNDLE, "--quiet"])


def export() -> int:
    return main.main(["recordings", "export", RECORDING, "--into", "steps.csv", "--quiet"])


KINDS = [  # The folder, the file in it, and the command that reads the file.
    *[("finished", f"{BASE}/seed0/{name}", run) for name in ("config.json", "provenance.json", "episodes.parquet")],
    *[("finished", f"{BASE}/seed0/{name}", build) for name in ("result.json", "curve.json", "config.json")],
    ("finished", f"{BASE}/training-0/weights/epoch-0004/seed0-val1.json", run),
    ("finished", f"{BASE}/training-0/weights/epoch-0004/seed0.safetensors", run),
    ("finished", f"{BASE}/training-0/timing.jsonl", run),
    *[
        ("unfinished", f"{BASE}/training-0/{name}", run)
        for name in ("checkpoint.safetensors", "metrics.jsonl", "config.json", "journals/000002.safetensors")
    ],
    ("search", "search.json", search),
    ("search", "blocks/000000.parquet", search),
    *[("submission", name, verify) for name in (BUNDLE, f"{BUNDLE}!bundle.json", f"{BUNDLE}!seed0/result.json")],
    ("recording", RECORDING, export),
]
# Another plausible value in these files is not noticed here: nothing beside them repeats the values.
UNPROTECTED = ("result.json", "curve.json", "provenance.json", "timing.jsonl", "times.json")


def mutated(content: bytes, name: str, rng: random.Random) -> bytes:
    """The content after a mutation that a disk, a program or a person may make."""
    ways = ["cut", "flip", "zero", "replace" if name.endswith(".json") else "flip"]
    match rng.choice(ways):
        case "cut":
            return content[: rng.randrange(len(content))]
        case "zero":
            start = rng.randrange(len(content))
            return content[:start] + bytes(min(16, len(content) - start)) + content[start + 16 :]
        case "replace":
            return json.dumps(replaced(json.loads(content), rng)).encode()
    place = rng.randrange(len(content))
    return content[:place] + bytes([content[place] ^ 1 << rng.randrange(8)]) + content[place + 1 :]


def replaced(value: Any, rng: random.Random) -> Any:
    """The value with one of its parts, at any depth, replaced by a strange value or removed."""
    if not isinstance(value, dict | list) or not value or rng.random() < 0.15:
        return rng.choice(STRANGE)
    place = rng.choice(list(value) if isinstance(value, dict) else range(len(value)))
    if rng.random() < 0.2:
        if isinstance(value, dict):
            return {name: part for name, part in value.items() if name != place}
        return [part for k, part in enumerate(value) if k != place]
    changed = replaced(value[place], rng)
    if isinstance(value, dict):
        return {**value, place: changed}
    return [changed if k == place else part for k, part in enumerate(value)]


def outputs(folder: Path) -> dict[str, bytes]:
    """What must not change silently: weights, episodes' values, results and tables."""
    files = {}
    for file in sorted(folder.rglob("*")):
        name = file.relative_to(folder).as_posix()
        if file.name == "result.json" and "/training" not in name:
            files[name] = json.dumps(json.loads(file.read_text()) | {"provenance": None}).encode()
        elif file.name in ("weights.safetensors", "curve.json", "draws.csv", "steps.csv"):
            files[name] = file.read_bytes()
        elif file.name == "episodes.parquet":
            files[name] = pd.read_parquet(file).drop(columns=["actions", "final"]).to_csv().encode()
    return files


def content_of(folder: Path, name: str) -> bytes:
    """The bytes of a file; `archive!member` names a member of an archive."""
    archive, _, member = name.partition("!")
    return zipfile.ZipFile(folder / archive).read(member) if member else (folder / name).read_bytes()


def put(folder: Path, name: str, content: bytes) -> None:
    """Replaces the bytes of a file, or of a member of an archive, whose checksum is then right again."""
    archive, _, member = name.partition("!")
    if member:
        with zipfile.ZipFile(folder / archive) as packed:
            members = {one: packed.read(one) for one in packed.namelist()} | {member: content}
        with zipfile.ZipFile(folder / archive, "w") as packed:
            for one, bytes_of_one in members.items():
                packed.writestr(one, bytes_of_one)
    else:
        (folder / name).write_bytes(content)


def peak_memory() -> int:
    """The largest memory until now, in bytes, of this process and of any process that it started."""
    return 1024 * max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def timed_out(number: int, frame: types.FrameType | None) -> None:
    raise AssertionError(f"the command took more than {LONGEST} s")


@pytest.mark.slow
@pytest.mark.parametrize(("state", "name", "command"), KINDS, ids=[f"{s}-{n.rpartition('/')[2]}" for s, n, _ in KINDS])
def test_a_mutation_is_named_or_changes_nothing(
    folders: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    thorough: bool,
    state: str,
    name: str,
    command: Any,
):
    rng = random.Random(f"{state} {name}")
    signal.signal(signal.SIGALRM, timed_out)
    original, codes = content_of(folders[state], name), []
    limit = peak_memory() + MOST_MEMORY
    expected: dict[str, Any] = {}
    for number in range((THOROUGH if thorough else COUNT) + 1):
        folder = tmp_path / str(number)
        shutil.copytree(folders[state], folder)
        monkeypatch.chdir(folder)
        content = mutated(original, name, rng) if number else original
        put(folder, name, content)
        signal.alarm(LONGEST)
        try:
            code = command()
        finally:
            signal.alarm(0)
        after = outputs(folder) if code == 0 else {}
        if number == 0:
            assert code == 0
            expected = after
        codes.append(code)
        assert code in ((0, 1, 2) if state == "submission" else (0, 2)), f"mutation {number}"
        if code == 0 and Path(name).name not in UNPROTECTED:
            assert after == expected, f"mutation {number}"
        shutil.rmtree(folder, ignore_errors=True)
    assert peak_memory() < limit
    assert state != "unfinished" or np.mean(codes) > 1.0  # Most mutations are noticed.
