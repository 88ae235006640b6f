"""The pictures of the Gymnasium environments."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dextron_bench.world.rendering.renderer import Renderer

FRAME = (480, 360)  # [px] width and height.
CAMERA = "side"


class Pictures:
    """Draws states with one renderer, which it makes for the first picture. A copy makes its own renderer."""

    def __init__(self) -> None:
        self._renderer: Renderer | None = None

    def __reduce__(self) -> tuple[type[Pictures], tuple[()]]:
        return Pictures, ()

    def draw(self, states: np.ndarray) -> np.ndarray:
        """Pictures (n, H, W, 3), 8 bit, of states (n, 48). Raises NoGraphics."""
        from dextron_bench.world.rendering import renderer  # Loads OpenGL, which most runs do not need.

        self._renderer = self._renderer or renderer.Renderer(*FRAME)
        if self._renderer.is_in_other_thread:
            return renderer.frames(states, *FRAME, CAMERA)
        return np.stack([self._renderer.render(state, renderer.CAMERAS[CAMERA]) for state in states])

    def close(self) -> None:
        """Frees the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
