"""How a recording opens: its plots, its text card, and the arrangement of the views."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk

from dextron_bench.recording import scene
from dextron_bench.rollout import Episode
from dextron_bench.world import task

EYE, TARGET = (0.66, -0.62, 0.40), (-0.07, -0.10, 0.20)  # [m] whence and whither the 3D view looks.
LINES = {  # Entity of plotted lines, their names and colours.
    "/episode/actions": {"action": (255, 150, 50)},
    "/signals/closure": {"closure": (90, 170, 255)},
    "/signals/metres": {
        "palm to bottle": (190, 120, 255),
        "bottle's height": (90, 210, 140),
        f"lifted from {task.LIFTED} m": (140, 140, 140),
    },
    "/episode/rewards": {"reward": (255, 210, 80)},
}
PLOTS = {  # Title of each plot, its lines, their range and where they are named.
    "Action and hand closure": (("/episode/actions", "/signals/closure"), (-1.1, 1.1), rrb.Corner2D.RightBottom),
    "Palm's distance, bottle's height [m]": (("/signals/metres",), (0.0, 0.7), rrb.Corner2D.RightTop),
    "Reward": (("/episode/rewards",), (-0.1, 1.1), rrb.Corner2D.LeftTop),
}
BACKGROUND = (33, 38, 45)


def signals(states: np.ndarray) -> Iterable[Chunk]:
    """What is plotted beside actions and rewards, derived from states (T, 48)."""
    lifted = np.full(len(states), task.LIFTED)
    metres = np.stack([task.distance(states), task.bottle_height(states), lifted], axis=1)
    when = scene.timelines(0, len(states) - 1)
    yield Chunk.from_columns("/signals/closure", when, rr.Scalars.columns(scalars=task.closure(states)))
    yield Chunk.from_columns("/signals/metres", when, rr.Scalars.columns(scalars=metres))


def lines() -> list[Chunk]:
    """Names and colours of the plotted lines, the same for every episode."""
    return [
        scene.static(entity, rr.SeriesLines(names=list(looks), colors=list(looks.values()), widths=[2.0] * len(looks)))
        for entity, looks in LINES.items()
    ]


def outcome(episode: Episode) -> str:
    """How the episode ended, in a few words."""
    if episode.failure:
        return "agent failed"
    if episode.terminated:
        return "bottle fell"
    return "success" if episode.success else "held too briefly" if episode.score else "not lifted"


def card(episode: Episode, properties: Mapping[str, object]) -> Chunk:
    """Outcome, properties and setting, to be read beside the plots."""
    told = {
        **properties,
        "reach": episode.setting.reach,
        "offset": f"{episode.setting.offset_x * 100:+.1f} cm, {episode.setting.offset_y * 100:+.1f} cm",
        "duration noise": f"{episode.setting.duration_noise:+.2f}",
    }
    told |= {"failure": episode.failure} if episode.failure else {}
    cells = [f"| {_cell(name.replace('_', ' '))} | {_cell(value)} |" for name, value in told.items()]
    cells += ["| | |"] * (len(cells) % 2)
    rows = "\n".join(left + right[1:] for left, right in zip(cells[::2], cells[1::2], strict=True))
    title = f"### {outcome(episode).capitalize()}: {episode.score:g} of {task.SUCCESS:g}, {len(episode.actions)} steps"
    table = f"| | | | |\n|---|---|---|---|\n{rows}\n"
    return scene.static("/card", rr.TextDocument(f"{title}\n\n{table}", media_type="text/markdown"))


def _cell(value: object) -> str:
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return text.replace("|", "/")


@cache
def blueprint() -> rrb.Blueprint:
    """3D view on the left; card and plots on the right; nothing else open."""
    eye = rrb.EyeControls3D(kind=rrb.Eye3DKind.Orbital, position=EYE, look_target=TARGET, eye_up=(0, 0, 1))
    start, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    trail = rrb.VisibleTimeRanges([rrb.VisibleTimeRange(line, start=start, end=now) for line in ("step", "seconds")])
    space = rrb.Spatial3DView(
        origin="/world",
        name="Grasp",
        eye_controls=eye,
        line_grid=False,
        background=rrb.Background(color=BACKGROUND),
        overrides={scene.TRACE: trail},
    )
    plots = [
        rrb.TimeSeriesView(
            name=name,
            contents=list(entities),
            axis_y=rrb.ScalarAxis(range=span, zoom_lock=True),
            plot_legend=rrb.PlotLegend(corner=corner),
        )
        for name, (entities, span, corner) in PLOTS.items()
    ]
    text = rrb.TextDocumentView(origin="/card", name="Episode")
    return rrb.Blueprint(
        rrb.Horizontal(space, rrb.Vertical(text, *plots, row_shares=[5, 4, 5, 3]), column_shares=[3, 2]),
        rrb.TimePanel(timeline="step", fps=50.0, play_state="paused", state="collapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )
