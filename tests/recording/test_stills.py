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
    posed = stills.hand_alone(start, 0.25)
    np.testing.assert_allclose(posed[joints], closed / 4)
    distal = {digit: float(posed[model.load().joint(f"{digit}_distal").qposadr[0]]) for digit in model.DIGITS}
    expected = dict.fromkeys(model.DIGITS, 1.57 / 4) | {"thumb": -0.57 / 4 / 0.9}  # The proximal is 0.9 of the distal.
    assert distal == pytest.approx(expected)


@pytest.mark.slow
def test_pictures_are_written_small_and_wide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stills, "LAMPS", 1)
    sizes = {file.name: Image.open(file).size for file in stills.write_pictures(tmp_path)}
    assert sizes == {"hero.png": (1280, 720), "hand-open-half-closed.png": (1278, 320)}
    assert all(file.stat().st_size < 400_000 for file in tmp_path.iterdir())
