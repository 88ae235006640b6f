"""Plays episodes: agents on settings, replays of recorded actions, and the cause of each failure."""
