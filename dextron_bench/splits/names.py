"""The names of splits, which the command line needs before anything is loaded."""

from __future__ import annotations

VAL = "val"  # The split on which everything is chosen.
SPLIT_NAMES = ("train", VAL, "test", "unseen-reach", "unseen-subject", "hard", "open")
EVALUATED = ("test", "unseen-reach", "unseen-subject", "hard")
