"""What a film shows over the picture: time, distance, action and closure, and at the end the outcome."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.recording import blueprint
from dextron_bench.world import model, task

SMALLEST = 120  # [pixels] height below which a film has no overlay: the text could not be read.
LINES = 26  # Lines of text that would fill the height of the picture.
WHITE, SHADE = (255, 255, 255, 255), (0, 0, 0, 150)
ACTION, CLOSURE = (255, 150, 50, 255), (90, 170, 255, 255)  # The colours of a recording's plots.
GOOD, BAD = (120, 230, 140, 255), (255, 130, 120, 255)
WIDTH = 25  # Of the panel, in heights of a line.
Colour = tuple[int, int, int, int]  # RGBA.


class Overlay:
    """Draws on the frames of an episode's film."""

    def __init__(self, episode: Episode, height: int) -> None:
        self._episode, self._unit = episode, max(height / LINES, 1.0)
        self._font = ImageFont.load_default(round(self._unit))
        self._distance, self._closure = task.distance(episode.states), task.closure(episode.states)
        self._score = np.concatenate([[0.0], np.cumsum(episode.rewards)])

    def draw(self, frame: np.ndarray, step: int) -> np.ndarray:
        """The frame (H, W, 3) of a step with the overlay."""
        picture = Image.fromarray(frame).convert("RGBA")
        layer = Image.new("RGBA", picture.size)
        self._draw_panel(ImageDraw.Draw(layer), step, picture.height)
        return np.asarray(Image.alpha_composite(picture, layer).convert("RGB"))

    def text(self, step: int) -> str:
        """The line of text of a step."""
        seconds, distance = step * model.CONTROL_STEP, self._distance[step]
        return f"{seconds:.2f} s   distance {distance:.3f} m   return {self._score[step]:g}"

    def _draw_panel(self, draw: ImageDraw.ImageDraw, step: int, height: int) -> None:
        unit = self._unit
        left, top = unit, height - 4.5 * unit
        right = WIDTH * unit
        draw.rectangle((left / 2, top - unit / 2, right + unit / 2, height - unit / 4), fill=SHADE)
        draw.text((left, top), self.text(step), fill=WHITE, font=self._font)
        last = len(self._episode.actions) - 1
        action = float(self._episode.actions[min(step, last), 0])
        self._draw_bar(draw, top + 1.3 * unit, right, "action", (0.0, action), ACTION)
        self._draw_bar(draw, top + 2.6 * unit, right, "closure", (-1.0, 2.0 * self._closure[step] - 1.0), CLOSURE)
        if step > last:
            self._draw_outcome(draw)

    def _draw_bar(
        self, draw: ImageDraw.ImageDraw, y: float, right: float, name: str, ends: tuple[float, float], colour: Colour
    ) -> None:
        """A bar whose box goes from -1 to 1."""
        unit, start = self._unit, 6 * self._unit
        low, high = (start + (right - start) * (np.clip(value, -1.0, 1.0) + 1.0) / 2.0 for value in sorted(ends))
        draw.text((unit, y), name, fill=WHITE, font=self._font)
        draw.rectangle((start, y + unit / 4, right, y + unit), outline=WHITE)
        draw.rectangle((low, y + unit / 4, high, y + unit), fill=colour)

    def _draw_outcome(self, draw: ImageDraw.ImageDraw) -> None:
        unit, outcome = self._unit, blueprint.outcome(self._episode)
        font = ImageFont.load_default(round(2 * unit))
        left, top, right, bottom = draw.textbbox((unit, unit), outcome, font=font)
        draw.rectangle((left - unit / 2, top - unit / 2, right + unit / 2, bottom + unit / 2), fill=SHADE)
        draw.text((unit, unit), outcome, fill=GOOD if self._episode.success else BAD, font=font)
