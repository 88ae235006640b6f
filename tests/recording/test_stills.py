"""The pictures of the README: a successful grasp, hands of given closures, and the sizes of the files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dextron_bench.recording import stills
from dextron_bench.world import model


def test_the_pictured_grasp_succeeds() -> None:
    assert stills.play_lift().success


def test_a_pictured_hand_has_the_given_closure() -> None:
    start = np.concatenate([model.initial_qpos(), np.zeros(23)])
    joints, closed = model.proximal()
    np.testing.assert_allclose(stills.hand_alone(start, 0.25)[joints], closed / 4)
    np.testing.assert_array_equal(stills.hand_alone(start, model.HALF_CLOSED)[14:], start[14:])


@pytest.mark.slow
def test_pictures_are_written_small_and_wide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stills, "LAMPS", 1)
    sizes = {file.name: Image.open(file).size for file in stills.write_pictures(tmp_path)}
    assert sizes == {"hero.png": (1280, 720), "hand-open-half-closed.png": (1278, 320)}
    assert all(file.stat().st_size < 400_000 for file in tmp_path.iterdir())
