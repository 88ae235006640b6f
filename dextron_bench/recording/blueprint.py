"""The layout of a recording in the viewer: plots, text, and how the views are arranged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.recording import phase_lane, scene, success_plots
from dextron_bench.world import task

EYE, TARGET = (
    (0.66, -0.62, 0.40),
    (-0.07, -0.10, 0.20),
)  # [m] position of the 3D view's camera, and the point in its centre.
LINES = {  # Entities of plotted lines, with the name and colour of each line.
    "/episode/actions": {"action": (255, 150, 50)},
    "/signals/closure": {"closure": (90, 170, 255)},
    "/signals/metres": {
        "palm to bottle": (190, 120, 255),
        "bottle's height": (90, 210, 140),
        f"lifted from {task.LIFTED} m": (140, 140, 140),
    },
    "/episode/rewards": {"reward": (255, 210, 80)},
    "/signals/expert": {"expert's action": (120, 200, 120)},
    "/success/chance": {"predicted success": (90, 150, 230), "threshold": (140, 140, 140)},
}
METRES = "Palm's distance, bottle's height [m]"  # The only plot with enough space for a legend.
PLOTS = {  # Title of each plot, the entities of its lines, and the range of its axis.
    "Action (orange), closure (blue)": (("/episode/actions", "/signals/closure"), (-1.1, 1.1)),
    METRES: (("/signals/metres",), (0.0, 0.7)),
    "Reward": (("/episode/rewards",), (-0.1, 1.1)),
}
PLOTS_WITH_PREDICTIONS = {  # The same for recordings with predictions of the success model.
    "Action (orange), expert's (green), closure (blue)": (
        ("/episode/actions", "/signals/closure", "/signals/expert"),
        (-1.1, 1.1),
    ),
    METRES: PLOTS[METRES],
    "Reward (yellow), predicted success (blue)": (("/episode/rewards", "/success/chance"), (-0.1, 1.1)),
}
HASH_LENGTH = 64  # Characters of a SHA-256; the text shows the first eight.
BACKGROUND = (33, 38, 45)


def signals(states: np.ndarray, first: int = 0) -> Iterable[Chunk]:
    """Plotted signals derived from states (T, 48), which start at step `first`: closure, distance and height."""
    lifted = np.full(len(states), task.LIFTED)
    metres = np.stack([task.distance(states), task.bottle_height(states), lifted], axis=1)
    times = scene.timelines(first, first + len(states) - 1)
    yield Chunk.from_columns("/signals/closure", times, rr.Scalars.columns(scalars=task.closure(states)))
    yield Chunk.from_columns("/signals/metres", times, rr.Scalars.columns(scalars=metres))


def action_chunk(actions: np.ndarray, first: int = 0) -> Chunk:
    """The agent's actions (T, 1) from step `first` on."""
    times = scene.timelines(first, first + len(actions) - 1)
    return Chunk.from_columns("/episode/actions", times, rr.Scalars.columns(scalars=actions))


def line_styles() -> list[Chunk]:
    """Names and colours of the plotted lines; equal for all episodes."""
    return [
        scene.static(entity, rr.SeriesLines(names=list(style), colors=list(style.values()), widths=[2.0] * len(style)))
        for entity, style in LINES.items()
    ]


def outcome(episode: Episode) -> str:
    """How the episode ended: "success", "bottle fell", "held too briefly", "not lifted" or "agent failed"."""
    if episode.failure:
        return "agent failed"
    if episode.terminated:
        return "bottle fell"
    return "success" if episode.success else "held too briefly" if episode.score else "not lifted"


def text_document(episode: Episode, properties: Mapping[str, object]) -> Chunk:
    """A table of outcome, properties and setting as text, which the viewer shows beside the plots."""
    entries = {
        **properties,
        "reach": episode.setting.reach,
        "offset": f"{episode.setting.offset_x * 100:+.1f} cm, {episode.setting.offset_y * 100:+.1f} cm",
        "duration noise": f"{episode.setting.duration_noise:+.2f}",
    }
    entries |= {"failure": episode.failure} if episode.failure else {}
    cells = [f"| {_cell(name.replace('_', ' '))} | {_cell(value)} |" for name, value in entries.items()]
    cells += ["| | |"] * (len(cells) % 2)
    rows = "\n".join(left + right[1:] for left, right in zip(cells[::2], cells[1::2], strict=True))
    title = f"### {outcome(episode).capitalize()}: {episode.score:g} of {task.SUCCESS:g}, {len(episode.actions)} steps"
    table = f"| | | | |\n|---|---|---|---|\n{rows}\n"
    return scene.static("/card", rr.TextDocument(f"{title}\n\n{table}", media_type="text/markdown"))


def _cell(value: object) -> str:
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    text = text[:8] if len(text) == HASH_LENGTH else text
    return text.replace("|", "/")


@cache
def blueprint(with_predictions: bool = False, live: bool = False) -> rrb.Blueprint:
    """Layout with the 3D view on the left, and text and plots on the right.

    With predictions it also has the success curve and the ridge plot. With `live` the viewer follows the newest step,
    without the lane of phases: where a movement of the hand begins is known only afterwards.
    """
    text = rrb.TextDocumentView(origin="/card", name="Episode")
    titles = PLOTS_WITH_PREDICTIONS if with_predictions else PLOTS
    plots = [_plot(title, entities, span) for title, (entities, span) in titles.items()]
    lane = {} if live else {phase_lane.view(): 3}
    shares = {text: 10, **lane, **dict(zip(plots, (8, 10, 6), strict=True))}
    column = rrb.Vertical(*shares, row_shares=list(shares.values()))
    if with_predictions:
        first_column = rrb.Vertical(spatial_view(), _bars(), row_shares=[5, 2])
        content = rrb.Horizontal(first_column, column, _ridge(), column_shares=[9, 7, 4])
    else:
        content = rrb.Horizontal(spatial_view(), column, column_shares=[3, 2])
    return with_time_panel(content, live)


def with_time_panel(content: rrb.Container, live: bool = False) -> rrb.Blueprint:
    """A layout of the content with the time panel below it; all other panels are hidden."""
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline="step", fps=50.0, play_state="following" if live else "paused", state="collapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def spatial_view(root: str = "", name: str = "Grasp") -> rrb.Spatial3DView:
    """The 3D view of the entities below a root, with the camera on the grasp."""
    eye = rrb.EyeControls3D(kind=rrb.Eye3DKind.Orbital, position=EYE, look_target=TARGET, eye_up=(0, 0, 1))
    start, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    trail = rrb.VisibleTimeRanges([rrb.VisibleTimeRange(line, start=start, end=now) for line in ("step", "seconds")])
    return rrb.Spatial3DView(
        origin=f"{root}/world",
        name=name,
        eye_controls=eye,
        line_grid=False,
        background=rrb.Background(color=BACKGROUND),
        overrides={root + scene.TRACE: trail},
    )


def _plot(title: str, entities: tuple[str, ...], span: tuple[float, float]) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        name=title,
        contents=list(entities),
        axis_y=rrb.ScalarAxis(range=span, zoom_lock=True),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=title == METRES),
    )


def _bars() -> rrb.BarChartView:
    contents = [f"/success/{name}" for name in ("curve", "chosen", "scale")]
    legend = rrb.PlotLegend(visible=False)
    return rrb.BarChartView(
        name="Chance of success by action, from open to close", contents=contents, plot_legend=legend
    )


def _ridge() -> rrb.Spatial2DView:
    bounds = rrb.VisualBounds2D(x_range=(-1.25, 1.25), y_range=(-success_plots.HEIGHT - 0.6, 0.4))
    return rrb.Spatial2DView(
        origin="/ridge",
        name="Chances, by share of the reach",
        background=rrb.Background(color=BACKGROUND),
        visual_bounds=bounds,
    )
