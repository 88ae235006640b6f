"""`dextron-bench leaderboard`."""
