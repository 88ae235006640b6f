"""Agents in processes of their own: how they start, what they may do, and what happens when they fail."""
