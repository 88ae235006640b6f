"""Trackers follow trainings of the tiny benchmark; each episode lasts three steps."""

from tests.training.conftest import tiny_splits

__all__ = ["tiny_splits"]
