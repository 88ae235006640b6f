"""What the authors of a submission say of it, as no one else can know."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Declaration:
    """What only the authors know: it stands on the leaderboard in their words, and nothing checks it."""

    frames: int | None = None
    """Control steps that it was trained for."""
    demonstrations: int | None = None
    """Expert episodes that it learned from."""
    hours: float | None = None
    """Hours of training."""
    hardware: str = ""
    """What it was trained on."""
    privileged: bool = False
    """It is told more than the 48 numbers of the state."""
    authors: str = ""
    """Whose it is."""
    url: str = ""
    """Where to read about it."""
    notes: str = ""
    """Anything else."""
