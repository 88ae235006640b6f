"""Small pictures of episodes: the last state, with the bottle lifted, standing or falling."""

from __future__ import annotations

import io
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from PIL import Image

from dextron_bench.world.rendering import renderer

WIDTH, HEIGHT = 320, 240  # [pixels]
CAMERA = replace(renderer.CAMERAS["side"], target=(-0.06, -0.06, 0.24))  # [m]; a bottle at 0.5 m is in the picture.
KEPT = 2000  # Pictures in memory, of 10 kB.


class Pictures:
    """Draws pictures, one at a time, and keeps them."""

    def __init__(self) -> None:
        self._worker = ThreadPoolExecutor(1)  # Off-screen graphics belong to the thread that creates them.
        self._renderer: renderer.Renderer | None = None
        self._drawn = dict[str, bytes]()
        self.problem = ""  # Why this machine cannot draw.

    def draw(self, key: str, state: np.ndarray) -> bytes | None:
        """A PNG of a state (48,), which always has the same key; None if this machine cannot draw."""
        return self._worker.submit(self._draw, key, state).result()

    def close(self) -> None:
        """Draws nothing more."""
        self._worker.shutdown(cancel_futures=True)

    def _draw(self, key: str, state: np.ndarray) -> bytes | None:
        if key not in self._drawn and not self.problem:
            try:
                self._renderer = self._renderer or renderer.Renderer(WIDTH, HEIGHT, supersampling=1)
            except renderer.NoGraphics as error:
                self.problem = str(error)
                return None
            self._drawn[key] = _png(self._renderer.render(state, CAMERA))
            if len(self._drawn) > KEPT:
                del self._drawn[next(iter(self._drawn))]
        return self._drawn.get(key)


def _png(picture: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(picture).quantize(128).save(stream, "PNG", optimize=True)
    return stream.getvalue()
