"""Small films of episodes, for trackers that show pictures."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.recording import film

STYLE = film.FilmStyle(width=320, height=240, speed=2.0)  # 25 frames for each second of the film.


def gif(episode: Episode) -> bytes:
    """A GIF of an episode at twice its speed; raises NoGraphics."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "episode.gif"
        film.gif(file, episode.states, STYLE)
        return file.read_bytes()
