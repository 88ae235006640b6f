"""Commands in a folder of a stranger: no file there is imported in the place of a library."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from dextron_bench.cli.commands import COMMANDS

ROOT = Path(__file__).parents[2]
SCRIPT = Path(sys.executable).with_name("dextron-bench")
LONGEST = 12.0  # [s] after which a command is ended.
STARTED = 20.0  # [s] after which a command has started all processes that it starts; a search takes hours.
PLANTED = "open(f'imported-{__name__}', 'w')\nraise ImportError(f'{__file__} was imported')\n"
OWN = {"dextron_bench", "baselines", "tests", "__main__"}
NAMES = {*sys.stdlib_module_names, *packages_distributions(), "sitecustomize", "usercustomize"} - OWN
MORE = {  # Words with which a command starts processes, or reads what lies in the working folder.
    "view": (["one.rrd", "--web", "--port", "0"], ["--live", "one.rrd"]),
    "run": (
        ["--method", "rlil", "--preset", "smoke", "--split", "val", "--tracker", "tensorboard"],
        ["--method", "nothing", "--split", "val", "--record", "24", "--threads", "2"],  # In two processes.
    ),
    "eval": (["--policies", "nosuch", "--quiet"],),
    "check": (["mine.py:Mine"],),
    "leaderboard": (["build"], ["serve", "--port", "0"]),
    "recordings": (["list", "one.rrd"], ["export", "one.rrd", "--into", "one.gif"]),
    "runs": (["list"], ["methods"]),
    "sweep": ([], ["cross-validate", "--method", "nothing"]),
    "data": (["splits"], ["mc"]),
    "doctor": ([],),
}
AGENT = """
class Mine:
    name = "mine"
    def agent(self, seed):
        return self
    def reset(self, episodes): ...
    def act(self, states):
        return -states[:, :1] ** 0
"""

pytestmark = pytest.mark.skipif(not SCRIPT.exists(), reason="the command is not installed")


@pytest.fixture
def planted(tmp_path: Path) -> Path:
    """A folder with a module of each name that the library or a package has."""
    for name in filter(str.isidentifier, NAMES):
        (tmp_path / f"{name}.py").write_text(PLANTED, encoding="utf-8")
    (tmp_path / "mine.py").write_text(AGENT, encoding="utf-8")
    (tmp_path / "one.rrd").write_bytes(next(iter(sorted((ROOT / "recordings").glob("*.rrd")))).read_bytes())
    (tmp_path / "leaderboard").mkdir()
    (tmp_path / "leaderboard" / "index.html").touch()
    return tmp_path


def imported(folder: Path, *words: str, seconds: float = LONGEST) -> list[str]:
    """The planted modules that a command imports; it may fail, and is ended as soon as it serves, or after a time."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [str(SCRIPT), *words]
    with (folder / "errors").open("wb") as errors:
        process = subprocess.Popen(command, cwd=folder, env=environment, stderr=errors, stdout=subprocess.PIPE)
    timer = threading.Timer(seconds, process.terminate)
    timer.start()
    with process:
        assert process.stdout
        for line in process.stdout:
            if line.startswith(b"http://"):
                process.terminate()
    timer.cancel()
    assert b"cannot be imported" not in (folder / "errors").read_bytes()
    return sorted(file.name for file in folder.glob("**/imported-*"))


@pytest.mark.slow
def test_a_command_that_starts_the_viewer_imports_nothing_from_the_working_folder(planted: Path):
    assert imported(planted, "view", "--web", "--port", "0", "one.rrd") == []
    assert b"viewer" not in (planted / "errors").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [name if name in ("run", "view", "check") else pytest.param(name, marks=pytest.mark.thorough) for name in COMMANDS],
)
def test_no_command_imports_anything_from_the_working_folder(planted: Path, name: str):
    for words in MORE.get(name, ([],)):
        assert imported(planted, name, *words, seconds=STARTED if words else LONGEST) == []
