"""The command line from end to end: each error is one line and an exit code, and results are machine-readable."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.cli import main
from tests.helpers import tiny_benchmark

HEAVY = {"mujoco", "torch", "pandas", "scipy", "matplotlib", "rerun", "pyarrow", "dm_control"}


@pytest.fixture
def here(tiny_world: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, with tiny splits of short reaches instead of the shipped splits."""
    monkeypatch.delenv("DEXTRON_DATA", raising=False)
    monkeypatch.setenv("DEXTRON_CACHE", str(tiny_world / "cache"))
    return tiny_world


def run(method: str, *words: str) -> list[str]:
    return ["run", "--method", method, "--split", "test", "--quiet", "--record", "0", *words]


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
    assert main.main(["runs", "methods"]) == 0
    assert "Replays the expert" in capsys.readouterr().out
    assert main.main(["data", "splits"]) == 0
    assert "unseen-reach" in capsys.readouterr().out
    assert main.main(["runs", "list", "--columns", "run", "splits"]) == 0
    assert re.search("nothing/synthetic.*open", capsys.readouterr().out)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (run("nosuch"), "no method 'nosuch'; choose from"),
        (run("mine.py:Mine"), "there is no file mine.py"),
        (["run", "--split", "tset"], "no split 'tset' of 'synthetic' reaches; choose from val, test"),
        (["run", "--reaches", "real"], "no split 'test' of 'real' reaches; none ships"),
        (["data", "info", "--reaches", "real"], "data import --from"),
        (["data", "mc", "--share", "2/2", "--reaches", "synthetic"], "share 2/2 does not exist"),
        (["data", "mc", "--seed", "-1"], "--seed is -1; it must be 0 or more"),
        (["run", "--seed", "0", "-1"], "--seed is -1; it must be 0 or more"),
        (["leaderboard", "serve", "--port", "65536"], "--port is 65536; it must be at most 65535"),
        (["data", "mc", "--threads", "2147483648"], "--threads is 2147483648; it must be at most 2147483647"),
        (["check", "reflex", "--memory", "nan"], "--memory is nan; it must be 0 or more"),
        (["runs", "list", "a\0b"], "'a\\x00b' has a zero byte, which no name of a file or of anything else has"),
        (["view"], "runs does not exist"),
        (["view", "nowhere"], "nowhere does not exist"),
        (["data", "splits", "--reaches", "synthetic", "--database", "no.parquet", "--into", "new"], "no.json"),
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


def test_a_leaderboard_without_results_explains_how_to_make_some(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(["leaderboard", "show"]) == 0
    assert "dextron-bench run" in capsys.readouterr().out
    assert main.main(["leaderboard", "show", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == []


def test_a_search_prints_json(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    from dextron_bench.experts.search_work import SearchWork

    draws = pd.DataFrame(
        [("a", 0.0, 0.0, 0.0, 1.0, 0.5, 20.0, 90)], columns=[*tiny_benchmark.COLUMNS[1:7], "score", "length"]
    )
    monkeypatch.setattr(SearchWork, "run", lambda *_, **__: draws)
    assert main.main(["data", "mc", "--json", "--quiet"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["kept"], summary["solved"]) == (1, 1)


def test_a_process_has_the_same_exit_codes(here: Path):
    """A shell sees what the tests above see of `main`."""
    process = tiny_benchmark.start(here / "data", *run("nosuch"))
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("dextron-bench: no method 'nosuch'; choose from ")


def test_help_and_the_package_itself_import_nothing_heavy():
    script = "import sys\ntry:\n from dextron_bench.cli.main import main; main(['--help'])\nexcept SystemExit: pass\n"
    done = subprocess.run(
        [sys.executable, "-c", f"{script}print('LOADED', *sys.modules)"], capture_output=True, text=True, check=True
    )
    help_text, _, loaded = done.stdout.partition("LOADED")
    assert "Exit codes" in help_text
    assert {"dextron_bench.cli.run"} <= set(loaded.split())
    assert not HEAVY & set(loaded.split())


@pytest.mark.slow
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
        ["runs", "methods"],
        ["leaderboard", "show"],
        ["leaderboard", "build"],
        ["view"],
        ["recordings", "list"],
        ["recordings", "export"],
        ["data", "splits"],
        ["data", "mc"],
        ["run"],
        ["eval"],
        ["compare"],
        ["compare", "plan"],
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


@pytest.mark.parametrize("words", [[], ["runs"], ["leaderboard"]])
def test_help_of_a_table_of_commands_has_no_examples(words: list[str], capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        main.main([*words, "--help"])
    text = capsys.readouterr().out
    assert "Example" not in text
    assert len(text.splitlines()) < 80


def test_too_little_memory_is_one_line_and_no_bug():
    assert main.explain(MemoryError("malloc of size 8"))[:2] == (2, "there is too little memory (malloc of size 8)")
    code, line = main.explain(ImportError("rerun.so: failed to map segment from shared object"))
    assert (code, line.startswith("there is too little memory (rerun.so: failed to map")) == (2, True)
