"""Playing episodes: agents on settings, replays of actions, and why episodes fail."""
