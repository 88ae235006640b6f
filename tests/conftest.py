"""Fixtures of many tests: the authors' release, a small one of the same form, bundles, a browser."""

from __future__ import annotations

import functools
import os
import shutil
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

from dextron_bench.cli import main
from dextron_bench.cli.support import output
from dextron_bench.reaches.recorded.cache import MissingData
from dextron_bench.reaches.setting import Source
from dextron_bench.reaches.sources import open_source
from tests.helpers import abilities, forged_bundles, forked_readers, tiny_benchmark, tiny_training
from tests.helpers.browser import open_browser
from tests.helpers.small_release import SmallRelease, make_small_release

hypothesis.settings.register_profile("any machine", deadline=None)  # A busy one stalls for a second.
hypothesis.settings.load_profile("any machine")

os.environ.setdefault("OMP_NUM_THREADS", "1")  # Each of several test processes would otherwise take every core.
os.environ.pop("DEXTRON_DEBUG", None)  # With it, an error is a traceback, not one line.

BESIDE = Path(__file__).parents[2] / "shared" / "data" / "dextron-a101b9e-extracts.zip"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--thorough",
        action="store_true",
        help="slow tests with many more mutations and kills, and those that run every week only",
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Tests marked `thorough` are slow ones, and are left out without `--thorough`."""
    chosen, left = [], []
    for item in items:
        is_thorough = item.get_closest_marker("thorough")
        if is_thorough:
            item.add_marker("slow")
        (left if is_thorough and not config.getoption("--thorough") else chosen).append(item)
    config.hook.pytest_deselected(items=left)
    items[:] = chosen


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, pytest.CollectReport, Any]:
    """A module that imports a package which is missing here is skipped."""
    report = yield
    abilities.skip_without(report, str(collector.path))
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, Any]:
    """A test that fails because this machine cannot draw, or lacks a package, is skipped."""
    report = yield
    abilities.skip_without(report, str(item.path))
    return report


@pytest.fixture(autouse=True)
def no_old_progress() -> None:
    """A test begins as a new process would: no report of an earlier test is a minute old, which prints a line.

    Without `monkeypatch`: it would then be undone after the fixtures of a test whose patches the test replaces, and
    so put those back.
    """
    output._Lines.printed = None


@pytest.fixture(scope="session", autouse=os.name == "posix")
def quick_readers() -> Iterator[None]:
    """Files of strangers are read by copies of one process, which saves some hundred starts of Python."""
    with forked_readers.installed():
        yield


@pytest.fixture(scope="session")
def thorough(request: pytest.FixtureRequest) -> bool:
    """True if the slow tests that draw mutations and kills shall draw many more."""
    return bool(request.config.getoption("--thorough"))


@pytest.fixture(scope="session")
def release() -> Path:
    """The path of the authors' release: DEXTRON_DATA, else beside the checkout. Skips the test if there is none."""
    named = os.environ.get("DEXTRON_DATA")
    path = Path(named) if named else BESIDE
    if not path.exists():
        pytest.skip("the authors' release is missing: set DEXTRON_DATA to its zip or folder")
    return path


@pytest.fixture
def opened(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Source]:
    """Opens a source of reaches by name; `real` reads what is imported, else the authors' release, or skips."""

    def opened(reaches: str) -> Source:
        try:
            return _opened_once(reaches, os.environ.get("DEXTRON_CACHE"), os.environ.get("DEXTRON_DATA"))
        except MissingData:
            monkeypatch.setenv("DEXTRON_DATA", str(request.getfixturevalue("release")))
            return _opened_once(reaches, os.environ.get("DEXTRON_CACHE"), os.environ["DEXTRON_DATA"])

    return opened


@functools.cache
def _opened_once(reaches: str, imported: str | None, release: str | None) -> Source:
    """A source of reaches; `real` depends on the two variables, and takes seconds to read from a release."""
    return open_source(reaches)


@pytest.fixture
def small_release(tmp_path: Path) -> SmallRelease:
    """A made-up release of three reaches."""
    return make_small_release(tmp_path)


@pytest.fixture
def rates(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Grows by the learning rate of each step of an optimiser Adam that is made from now on."""
    import torch

    used: list[float] = []

    class Watched(torch.optim.Adam):
        def step(self, closure: Any = None) -> Any:
            used.append(self.param_groups[0]["lr"])
            return super().step(closure)

    monkeypatch.setattr(torch.optim, "Adam", Watched)
    return used


@pytest.fixture
def complaint(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """The one line on stderr of a command that ends with code 2 and no result."""

    def run(*words: str) -> str:
        capsys.readouterr()
        try:
            code = main.main(list(words))
        except SystemExit as ended:
            code = ended.code
        printed = capsys.readouterr()
        assert (code, printed.out, printed.err.count("\n")) == (2, "", 1)
        assert printed.err.startswith("dextron-bench: ")
        return printed.err

    return run


@pytest.fixture
def tiny_world(tmp_path: Path) -> Iterator[Path]:
    """An empty working folder in the tiny world, whose splits lie in data/."""
    with tiny_benchmark.working_folder(tmp_path):
        yield tmp_path


@pytest.fixture
def training_world(tmp_path: Path) -> Iterator[Path]:
    """An empty working folder in the tiny world with rows of `train`, for methods that learn."""
    with tiny_training.working_folder(tmp_path):
        yield tmp_path


@pytest.fixture(scope="session")
def played_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with runs/ of the tiny world: `exp` solves both rows of `test`, recorded; `nothing` solves none."""
    with tiny_benchmark.working_folder(tmp_path_factory.mktemp("played")) as folder:
        for words in (["exp", "--record", "2"], ["nothing", "--record", "0"]):
            assert main.main(["run", "--method", *words, "--split", "test", "--quiet", "--json"]) == 0
    return folder


@pytest.fixture
def two_runs(tiny_world: Path, played_runs: Path) -> Path:
    """A working folder in the tiny world with a copy of these runs."""
    shutil.copytree(played_runs / "runs", tiny_world / "runs")
    return tiny_world


@pytest.fixture(scope="session")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with sound bundles, the agent near.py and the runs that they were made from. Tests leave it as it is."""
    return forged_bundles.play(tmp_path_factory.mktemp("submission"))


@pytest.fixture(scope="module")
def submitted(played: Path) -> Iterator[Path]:
    """The folder with the bundles near.zip, of one seed, and twins.zip, of two; their benchmark is installed."""
    with forged_bundles.installed(played):
        yield played


@pytest.fixture
def forged(submitted: Path, tmp_path: Path) -> forged_bundles.Forgery:
    """The sound bundle of one seed, taken apart."""
    return forged_bundles.taken_apart(submitted / "near.zip", tmp_path)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless browser; skips where there is none."""
    with open_browser() as opened:
        yield opened
