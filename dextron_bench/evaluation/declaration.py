"""What the authors of a submission state about it, because nobody else can know it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

Count = Annotated[int, Meta(ge=0, le=10**15)]
Hours = Annotated[float, Meta(ge=0.0, le=1e9)]


@dataclass(frozen=True, slots=True)
class Declaration:
    """What only the authors know; the leaderboard shows it unchecked."""

    frames: Count | None = None
    """Number of control steps in its training."""
    demonstrations: Count | None = None
    """Number of expert episodes that it learned from."""
    hours: Hours | None = None
    """Hours of training."""
    hardware: str = ""
    """Hardware of the training."""
    rule: bool = False
    """The agent was not trained, and acts the same with every seed."""
    privileged: bool = False
    """The agent uses more than the 48 numbers of the state."""
    authors: str = ""
    """Names of the authors."""
    url: str = ""
    """Address of a page about it."""
    notes: str = ""
    """Anything else."""
