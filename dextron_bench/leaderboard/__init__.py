"""The leaderboard: published results, its page, submissions and their verification."""
