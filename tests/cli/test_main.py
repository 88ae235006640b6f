"""The command line from end to end: each error is one line and an exit code, and results are machine-readable.

Long, because every kind of error is tried once through the whole command line.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.runs.result_files import read_result
from dextron_bench.storage import atomic
from tests.helpers import tiny_benchmark

AGENT = """
import numpy as np

class Mine:
    name = "mine"
    def agent(self, seed): return self
    def reset(self, episodes): ...
    def act(self, states):
        actions = np.zeros((len(states), 1))
        {spoil}
        return actions
"""
HEAVY = {"mujoco", "torch", "pandas", "scipy", "matplotlib", "rerun", "pyarrow", "dm_control"}


@pytest.fixture
def here(tiny_world: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, with tiny splits of short reaches instead of the shipped splits."""
    monkeypatch.delenv("DEXTRON_DATA", raising=False)
    monkeypatch.delenv("DEXTRON_DEBUG", raising=False)
    monkeypatch.setenv("DEXTRON_CACHE", str(tiny_world / "cache"))
    return tiny_world


def mine(folder: Path, spoil: str) -> str:
    """A method whose agent sends zeros, except for what the statement `spoil` changes."""
    (folder / "mine.py").write_text(AGENT.format(spoil=spoil))
    return "mine.py:Mine"


def run(method: str, *words: str) -> list[str]:
    return ["run", "--method", method, "--split", "test", "--no-floors", "--quiet", "--record", "0", *words]


def test_stdout_holds_json_and_nothing_else(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main([*run("exp", "--json"), "--record", "1"]) == 0
    printed = capsys.readouterr()
    (row,) = json.loads(printed.out)
    assert (row["method"], row["reaches"], row["split"], row["episodes"]) == ("exp", "synthetic", "test", 2)
    assert (row["return"], row["success"], row["failed"]) == (20.0, 1.0, 0)
    assert printed.err == ""
    assert main.main(["leaderboard", "show", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [row]


def test_a_run_prints_the_folder_of_its_files(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(["run", "--method", "nothing", "--split", "open", "--quiet"]) == 0
    printed = capsys.readouterr().out
    assert "runs/nothing/synthetic/seed0" in printed
    assert "random" in printed  # The other floor.
    assert main.main(["list"]) == 0
    printed = capsys.readouterr().out
    assert "Replays the expert" in printed
    assert "unseen-reach" in printed


def test_an_agent_that_fails_in_some_episodes_is_code_3_and_other_episodes_count(
    here: Path, capsys: pytest.CaptureFixture[str]
):
    for spoil, failure in (("actions[0] = np.nan", "action is nan"), ("actions[0] = 1.001", "is outside [-1, 1]")):
        assert main.main(run(mine(here, spoil), "--json", "--runs", failure[:9])) == 3
        (row,) = json.loads(capsys.readouterr().out)
        assert (row["episodes"], row["failed"]) == (2, 1)
        episodes = pd.read_parquet(here / failure[:9] / "mine" / "synthetic" / "seed0" / "episodes.parquet")
        assert failure in episodes["failure"][0]
        assert (episodes["failure"][1], episodes["length"][0]) == ("", 0)
        assert episodes["length"][1] > 30
        for name in [name for name in sys.modules if name.startswith("dextron_entrant_")]:
            del sys.modules[name]


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        ("actions = actions[:, 0]", "act() must return floats of shape (2, 1)"),
        ("actions = None", "act() must return floats"),
        ("raise ZeroDivisionError('oh')", "the agent's act() raised ZeroDivisionError: oh"),
        ("raise OSError(2, 'No weights')", "raised FileNotFoundError: [Errno 2] No weights"),
    ],
)
def test_an_agent_that_cannot_play_is_one_line(here: Path, complaint: Callable[..., str], spoil: str, expected: str):
    assert expected in complaint(*run(mine(here, spoil)))
    assert not list(here.rglob("result.json"))


def test_an_agent_that_cannot_begin_is_one_line(here: Path, complaint: Callable[..., str]):
    assert "agent(-1) of method 'random' raised ValueError" in complaint(*run("random", "--seed", "-1"))


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (run("nosuch"), "no method 'nosuch'; choose from"),
        (run("mine.py:Mine"), "there is no file mine.py"),
        (["run", "--split", "tset"], "no split 'tset' of 'synthetic' reaches; choose from val, test"),
        (["run", "--reaches", "real"], "no split 'test' of 'real' reaches; none ships"),
        (["data", "info", "--reaches", "real"], "data import --from"),
        (["mc", "--share", "2/2", "--reaches", "synthetic"], "share 2/2 does not exist"),
        (["mc", "--seed", "-1"], "a seed of 0 or more"),
        (["view"], "runs does not exist"),
        (["view", "nowhere"], "nowhere does not exist"),
        (["splits", "--reaches", "synthetic", "--database", "no.parquet", "--into", "new"], "no.json"),
    ],
)
def test_missing_files_and_names_are_one_line(
    here: Path, complaint: Callable[..., str], words: list[str], expected: str
):
    assert expected in complaint(*words)
    assert sorted(os.listdir(here)) == ["data"]


@pytest.mark.parametrize(
    "words", [["nosuch"], ["run", "--reaches", "nosuch"], ["run", "--seed", "x"], ["view", "--row", "x"]]
)
def test_wrong_arguments_are_code_2(words: list[str], capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as caught:
        main.main(words)
    assert caught.value.code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "--help" in printed.err or words[-1] in printed.err


def test_real_reaches_that_were_not_imported_are_one_line(here: Path, complaint: Callable[..., str]):
    catalogue = here / "data" / "splits.json"
    catalogue.write_text(catalogue.read_text().replace("synthetic", "real"))
    (here / "data" / "splits-synthetic.parquet").rename(here / "data" / "splits-real.parquet")
    words = ["run", "--reaches", "real", "--split", "val"]
    assert "the recorded reaches have not been imported: run `dextron-bench data import" in complaint(*words)
    assert not (here / "runs").exists()


def test_a_file_where_the_folder_should_be_is_one_line(here: Path, complaint: Callable[..., str]):
    (here / "runs").write_text("")
    assert "runs" in complaint(*run("nothing"))
    assert (here / "runs").read_text() == ""


def test_a_full_disk_is_one_line_and_leaves_no_partial_file(
    here: Path, monkeypatch: pytest.MonkeyPatch, complaint: Callable[..., str]
):
    write_atomically = atomic.write_atomically

    def full(file: Path, write: Callable[[Path], object]) -> None:
        def fill(part: Path) -> None:
            write(part)
            part.write_bytes(part.read_bytes()[:50])
            raise OSError(28, "No space left on device", str(file))

        write_atomically(file, fill if file.name == "episodes.parquet" else write)

    monkeypatch.setattr(atomic, "write_atomically", full)
    line = complaint(*run("nothing"))
    assert "No space left on device: runs/nothing/synthetic/seed0/episodes.parquet" in line
    assert sorted(os.listdir("runs/nothing/synthetic/seed0")) == ["config.json", "failure.json", "provenance.json"]


@pytest.mark.parametrize("name", ["episodes.parquet", "result.json", "config.json"])
def test_a_damaged_run_is_one_line_with_the_file(
    here: Path, capsys: pytest.CaptureFixture[str], complaint: Callable[..., str], name: str
):
    words = ["run", "--method", "nothing", "--split", "open", "--no-floors", "--quiet"]
    assert main.main(words) == 0
    file = here / "runs" / "nothing" / "synthetic" / "seed0" / name
    file.write_bytes(file.read_bytes()[:20])
    line = complaint(*(["leaderboard", "show"] if name == "result.json" else words))
    assert f"runs/nothing/synthetic/seed0/{name} is damaged" in line
    assert "remove it and run again" in line
    file.unlink()
    if name != "config.json":
        assert main.main(words) == 0  # As the line said.


def test_a_damaged_split_is_one_line(here: Path, complaint: Callable[..., str]):
    file = here / "data" / "splits-synthetic.parquet"
    file.write_bytes(file.read_bytes()[:100])
    assert "reinstall the package" in complaint(*run("nothing"))
    assert "reinstall the package" in complaint("list")


def test_a_leaderboard_without_results_explains_how_to_make_some(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(["leaderboard", "show"]) == 0
    assert "dextron-bench run" in capsys.readouterr().out
    assert main.main(["leaderboard", "show", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == []


def test_a_search_prints_json(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    from dextron_bench.experts import montecarlo

    draws = pd.DataFrame(
        [("a", 0.0, 0.0, 0.0, 1.0, 0.5, 20.0, 90)], columns=[*tiny_benchmark.COLUMNS[1:7], "score", "length"]
    )
    monkeypatch.setattr(montecarlo, "run", lambda *_, **__: draws)
    assert main.main(["mc", "--json", "--quiet"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["kept"], summary["solved"]) == (1, 1)


def test_a_process_has_the_same_exit_codes(here: Path):
    """A shell sees what the tests above see of `main`."""
    process = tiny_benchmark.start(here / "data", *run("nosuch"))
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("dextron-bench: no method 'nosuch'; choose from ")


def test_an_interrupted_run_is_code_130_and_continues_later(here: Path, capsys: pytest.CaptureFixture[str]):
    spoil = "import time; open('started', 'w').close(); time.sleep(0.05)"
    words = run(mine(here, spoil))
    process = tiny_benchmark.start(here / "data", *words)
    waited = time.monotonic()
    while not (here / "started").exists() and time.monotonic() - waited < 120 and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (130, "dextron-bench: interrupted\n")
    left = here / "runs" / "mine" / "synthetic" / "seed0"
    assert sorted(os.listdir(left)) == ["config.json", "provenance.json"]
    assert main.main(words) == 0
    assert len(read_result(left / "result.json")["splits"]["test"]["scores"]) == 2


def test_help_and_the_package_itself_import_nothing_heavy():
    script = "import sys\ntry:\n from dextron_bench.cli.main import main; main(['--help'])\nexcept SystemExit: pass\n"
    done = subprocess.run(
        [sys.executable, "-c", f"{script}print('LOADED', *sys.modules)"], capture_output=True, text=True, check=True
    )
    help_text, _, loaded = done.stdout.partition("LOADED")
    assert "Exit codes" in help_text
    assert {"dextron_bench.cli.run"} <= set(loaded.split())
    assert not HEAVY & set(loaded.split())


def test_products_of_numpy_and_torch_use_one_thread_by_default():
    script = (
        "from dextron_bench.cli.main import main; main(['--version']); import numpy, threadpoolctl, torch; "
        "pools = threadpoolctl.threadpool_info(); "
        "print({p['num_threads'] for p in pools if p['internal_api'] == 'openblas'}, torch.get_num_threads())"
    )
    inherited = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    two = min(2, len(os.sched_getaffinity(0)))  # OpenBLAS starts no more threads than it has processors.
    for more, threads in (
        ({}, "{1} 1"),
        ({"OPENBLAS_NUM_THREADS": "2"}, f"{{{two}}} 1"),
        ({"OMP_NUM_THREADS": "2"}, "{1} 2"),
    ):
        done = subprocess.run(
            [sys.executable, "-c", script], env=inherited | more, capture_output=True, text=True, check=True
        )
        assert done.stdout.endswith(f"{threads}\n")


@pytest.mark.parametrize(
    "words",
    [
        ["doctor"],
        ["list"],
        ["leaderboard", "show"],
        ["leaderboard", "build"],
        ["view"],
        ["recordings", "list"],
        ["recordings", "export"],
        ["splits"],
        ["mc"],
        ["run"],
        ["eval"],
        ["compare"],
        ["plan"],
        ["success", "data"],
        ["success", "train"],
        ["success", "eval"],
        ["success", "explain"],
    ],
)
def test_help_of_a_command_has_an_example(words: list[str], capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as caught:
        main.main([*words, "--help"])
    assert caught.value.code == 0
    assert f"Example: dextron-bench {words[0]}" in capsys.readouterr().out
