"""Renders the README's pictures from an episode on minimum-jerk reaches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.reaches.minjerk import MinjerkSource
from dextron_bench.reaches.setting import Setting
from dextron_bench.splits.rows import Rows
from dextron_bench.storage import atomic
from dextron_bench.world import model
from dextron_bench.world.rendering import renderer

EXPERT = Expert(gain=2.0, critical=0.15)  # Succeeds on minimum-jerk reaches (Sharif et al., 2020).
CLOSURES = (0.0, 0.5, 1.0)
LAMPS = 24  # A picture is the average over this number of positions of the key light.
BEFORE_END = 10  # Control steps before the end of the episode; this state is shown.
CLEAR = (0.0, 5.0, 0.0)  # [m] position of the bottle in pictures of the hand alone.


def write_pictures(folder: Path) -> list[Path]:
    """Writes hero.png and hand-open-half-closed.png to `folder`; returns their paths. Raises NoGraphics, OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    lifted = play_lift().states[-BEFORE_END]
    hands = [renderer.render(hand_alone(lifted, closure), 426, 320, "hand", LAMPS) for closure in CLOSURES]
    pictures = {
        "hero.png": renderer.render(lifted, 1280, 720, "hero", LAMPS),
        "hand-open-half-closed.png": np.concatenate(hands, axis=1),
    }
    for name, picture in pictures.items():
        image = Image.fromarray(picture)
        atomic.write_atomically(folder / name, lambda part, image=image: image.save(part, "PNG", optimize=True))
    return [folder / name for name in pictures]


def play_lift() -> Episode:
    """A successful episode: the expert on the first minimum-jerk reach."""
    source = MinjerkSource()
    row = Rows(cases=(Case(Setting(source.names[0], 0.0, 0.0, 0.0), EXPERT, window=0.0),))
    return next(episode for _, episode in rollout(ExpertAgent(), source, row))


def hand_alone(state: np.ndarray, closure: float) -> np.ndarray:
    """A state (48,) with the bottle out of view and all digits at a closure, from 0 (open) to 1 (closed)."""
    physics = model.load()
    posed = state.copy()
    posed[model.BOTTLE_POSITION] = CLEAR
    posed[physics.joint("thumb_base").qposadr] = model.THUMB_OPPOSED
    for digit, joint, closed in zip(model.DIGITS, *model.proximal(), strict=True):
        posed[joint] = closed * closure
        posed[physics.joint(f"{digit}_distal").qposadr] = closed * closure / physics.equality(digit).data[1]
    return posed
