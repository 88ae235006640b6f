"""Reaches: hand trajectories, recorded, synthetic or simulated, and the settings made of them (paper, II.B)."""
