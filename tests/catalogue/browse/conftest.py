"""A catalogue of two runs in the tiny world, and a server of it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.catalogue import episodes as catalogue
from dextron_bench.catalogue.browse.site import BrowseSite
from dextron_bench.web.local_server import LocalServer, ViewerFiles


@pytest.fixture
def runs(two_runs: Path) -> Path:
    """Two runs on two rows of `test`: the experts solve both, and `nothing` solves none."""
    return two_runs / "runs"


@pytest.fixture
def episodes(runs: Path) -> pd.DataFrame:
    return catalogue.read([runs])


@pytest.fixture
def shown() -> list[Path]:
    """The recordings that the site shows; the native viewer itself would need a screen."""
    return []


@pytest.fixture
def viewer() -> ViewerFiles | None:
    """The files of the web viewer; without them the native viewer opens."""
    return None


@pytest.fixture
def server(episodes: pd.DataFrame, shown: list[Path], viewer: ViewerFiles | None) -> Iterator[LocalServer]:
    """A server of the catalogue."""
    site = BrowseSite(episodes, None if viewer else shown.append, viewer)
    with LocalServer(site, 0) as opened:
        thread = threading.Thread(target=opened.serve_forever, daemon=True)
        thread.start()
        yield opened
        opened.shutdown()
        thread.join()
    site.close()
