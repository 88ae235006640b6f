"""The web viewer of the leaderboard's server opens a recording in its layout, not in Rerun's automatic grid."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.leaderboard import server as leaderboard_server
from dextron_bench.recording import episode_file, web_viewer_files
from tests.helpers.short_reaches import SETTINGS, SOURCE

PATIENCE = 180  # [s] for the viewer to draw the layout; software rendering takes about 20 s.
GRASP_VIEW = slice(80, 400), slice(20, 800)  # Rows and columns of the screen [pixels] where the layout has the hand.
DARK = 60  # Brightness below which a pixel belongs to the dark background of that view.


@pytest.fixture
def server(tmp_path: Path) -> Iterator[leaderboard_server.Server]:
    """A server with Rerun's viewer and a recording of 0.6 MB: a small one opens well in either order."""
    case = Case(SETTINGS[0], Expert(1.4, 0.2), 0.1)
    [(_, episode)] = rollout(ExpertAgent(), SOURCE, [case], threads=1)
    for folder in ("board", "recordings"):
        (tmp_path / folder).mkdir()
    episode_file.write(tmp_path / "recordings/a.rrd", episode, SOURCE.path(case.setting), {"method": "exp"})
    (tmp_path / "board/index.html").write_text('<a href="../recordings/a.rrd">success</a>')
    site = leaderboard_server.Site(tmp_path / "board", dict(web_viewer_files()))
    with leaderboard_server.Server(site, 0) as opened:
        thread = threading.Thread(target=opened.serve_forever, daemon=True)
        thread.start()
        yield opened
        opened.shutdown()
        thread.join()


@pytest.mark.slow
def test_a_recording_opens_in_its_layout(server: leaderboard_server.Server, browser: Any):
    """The automatic grid has white panels where the layout has one large view with a dark background."""
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto(server.address)
    page.click("a")
    deadline, dark = time.monotonic() + PATIENCE, 0.0
    while dark < 0.9 and time.monotonic() < deadline:
        page.wait_for_timeout(3000)
        picture = Image.open(io.BytesIO(page.screenshot(timeout=1000 * PATIENCE))).convert("RGB")
        dark = float((np.asarray(picture)[GRASP_VIEW].max(axis=2) < DARK).mean())
    page.close()
    assert dark >= 0.9
