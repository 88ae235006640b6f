"""The leaderboard's page: one HTML file, computed from results."""

from dextron_bench.leaderboard.page.document import FILE, document

__all__ = ["FILE", "document"]
