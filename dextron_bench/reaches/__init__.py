"""Reaches: hand trajectories, recorded, synthetic or simulated, and the settings of episodes (paper, II.B)."""
