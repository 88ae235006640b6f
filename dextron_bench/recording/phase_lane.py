"""The lane of an episode's phases, in colours, above the plots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk

from dextron_bench.evaluation.phases import PHASES
from dextron_bench.recording import scene

ENTITY = "/phase"
COLOURS = ((110, 120, 135), (190, 120, 255), (255, 150, 50), (90, 170, 255), (90, 210, 140))  # One for each phase.


def chunk(places: np.ndarray, first: int = 0) -> Chunk:
    """The phases (T,) of states from step `first` on, as places in PHASES: a row at the start of each one."""
    starts = np.flatnonzero(np.diff(places, prepend=-1))
    names = [PHASES[place] for place in places[starts]]
    return Chunk.from_columns(ENTITY, scene.timelines_at(first + starts), rr.StateChange.columns(state=names))


def style() -> Chunk:
    """Names and colours of the phases; equal for all episodes."""
    return scene.static(ENTITY, rr.StateConfiguration(values=list(PHASES), labels=list(PHASES), colors=COLOURS))


def view(sides: Sequence[str] = ("",)) -> rrb.StateTimelineView:
    """The lane of an episode, or a lane for each of several episodes below the roots `sides`."""
    return rrb.StateTimelineView(origin="/", contents=[side + ENTITY for side in sides], name="Phase", titlebar=False)
