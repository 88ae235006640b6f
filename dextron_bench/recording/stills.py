"""The pictures of the README, made from an episode of the minimum-jerk world."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.reaches.minjerk import MinjerkSource
from dextron_bench.reaches.setting import Setting
from dextron_bench.world import model
from dextron_bench.world.rendering import renderer

EXPERT = Expert(gain=2.0, critical=0.15)  # Succeeds in the minimum-jerk world (Sharif et al., 2020).
CLOSURES = (0.0, model.HALF_CLOSED, 1.0)
LAMPS = 24  # Places of the key light that a picture is averaged over.
BEFORE_END = 10  # Control steps before the end at which the lift is shown.
CLEAR = (0.0, 5.0, 0.0)  # [m] where the bottle is put to show the hand alone.


def write_pictures(folder: Path) -> list[Path]:
    """Writes hero.png and hand-open-half-closed.png to `folder`; returns their paths. Raises NoGraphics."""
    folder.mkdir(parents=True, exist_ok=True)
    lifted = play_lift().states[-BEFORE_END]
    hands = [renderer.render(hand_alone(lifted, closure), 426, 320, "hand", LAMPS) for closure in CLOSURES]
    pictures = {
        "hero.png": renderer.render(lifted, 1280, 720, "hero", LAMPS),
        "hand-open-half-closed.png": np.concatenate(hands, axis=1),
    }
    for name, picture in pictures.items():
        Image.fromarray(picture).save(folder / name, optimize=True)
    return [folder / name for name in pictures]


def play_lift() -> Episode:
    """A grasp that succeeds: the expert on the first reach of the minimum-jerk world."""
    source = MinjerkSource()
    case = Case(Setting(source.names[0], 0.0, 0.0, 0.0), EXPERT, window=0.0)
    return next(episode for _, episode in rollout(ExpertAgent(), source, [case]))


def hand_alone(state: np.ndarray, closure: float) -> np.ndarray:
    """The state (48,) with the bottle out of sight and every digit closed so far, 0 open to 1 closed."""
    compiled = model.load()
    posed = state.copy()
    posed[model.BOTTLE_POSITION] = CLEAR
    for digit, joint, closed in zip(model.DIGITS, *model.proximal(), strict=True):
        posed[joint] = closed * closure
        posed[compiled.joint(f"{digit}_distal").qposadr] = closed * closure * compiled.equality(digit).data[1]
    return posed
