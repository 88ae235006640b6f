"""The authors' release where it is at hand, and a tiny one of the same shape where it is not."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.cli import main
from dextron_bench.reaches.setting import Source
from dextron_bench.reaches.sources import open_source
from tests.helpers import forged_bundles
from tests.helpers.browser import open_browser

os.environ.setdefault("OMP_NUM_THREADS", "1")  # Each of several test processes would otherwise take every core.

BESIDE = Path(__file__).parents[2] / "shared" / "data" / "dextron-a101b9e-extracts.zip"
NAMES = ("01_fl_01", "01_fl_06", "02_nr_16")
START = 3.5  # [s] first sample on the recorder's clock.


@pytest.fixture(scope="session")
def release() -> Path:
    """The authors' release, as DEXTRON_DATA names it or as it lies beside the checkout; skips where absent."""
    named = os.environ.get("DEXTRON_DATA")
    found = Path(named) if named else BESIDE
    if not found.exists():
        pytest.skip("the authors' release is not here: set DEXTRON_DATA to its zip or folder")
    return found


@pytest.fixture
def opened(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Source]:
    """Opens a source of reaches by name; `real` reads the authors' release, or skips."""

    def opened(reaches: str) -> Source:
        if reaches == "real":
            monkeypatch.setenv("DEXTRON_DATA", str(request.getfixturevalue("release")))
        return open_source(reaches)

    return opened


@dataclass(frozen=True)
class Published:
    """A release of three made-up reaches: file contents by name from `extracts/` on, and where its files go."""

    files: dict[str, bytes]
    folder: Path

    @property
    def manifest(self) -> Path:
        """The manifest file of the undamaged release."""
        return self.folder / "manifest.json"

    def zip(self, changed: dict[str, bytes] | None = None, top: str = "dextron-abc/data/") -> Path:
        """Writes the release as a zip, with some contents changed or added."""
        where = self.folder / "release.zip"
        with zipfile.ZipFile(where, "w", zipfile.ZIP_DEFLATED) as archive:
            for file, content in {**self.files, **(changed or {})}.items():
                archive.writestr(top + file, content)
        return where

    def unpacked(self) -> Path:
        """Writes the release as a folder and returns its top."""
        top = self.folder / "dextron-abc"
        for file, content in self.files.items():
            place = top / "data" / file
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(content)
        return top


@pytest.fixture
def published(tmp_path: Path) -> Published:
    """A made-up release: each reach has six samples 0.1 s apart, moving 0.1 m along x, `reached` after 0.3 s."""
    rows = [{"q": [1.0, 0.0, 0.0, 0.0], "x": [-0.5 + 0.1 * i, -0.2, -0.1], "t": START + 0.1 * i} for i in range(6)]
    samples = "".join(json.dumps(row) + "\n" for row in rows).encode()
    notes = json.dumps([["start", START], ["reached", START + 0.3], ["top", START + 0.5]]).encode()
    files = {f"extracts/{name}.json": samples for name in NAMES}
    files |= {f"extracts/meta/{name}_meta.json": notes for name in NAMES}
    made = Published(files, tmp_path / "published")
    made.folder.mkdir()
    hashes = {file: hashlib.sha256(content).hexdigest() for file, content in files.items()}
    made.manifest.write_text(json.dumps({"files": hashes}))
    return made


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


@pytest.fixture(scope="module")
def submitted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a sound bundle, near.zip, the agent near.py and the runs that it was made from."""
    yield from forged_bundles.submitted(tmp_path_factory.mktemp("submission"))


@pytest.fixture
def forged(submitted: Path, tmp_path: Path) -> forged_bundles.Forgery:
    """The sound bundle, taken apart."""
    return forged_bundles.taken_apart(submitted / "near.zip", tmp_path)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless browser; skips where there is none."""
    with open_browser() as opened:
        yield opened
