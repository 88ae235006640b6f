"""The leaderboard's page: one HTML file with all that it shows, made from results alone."""

from dextron_bench.leaderboard.page.document import FILE, document

__all__ = ["FILE", "document"]
