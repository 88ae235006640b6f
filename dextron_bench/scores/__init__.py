"""Scores: estimates, ranks and comparisons computed from results, and their figures."""
