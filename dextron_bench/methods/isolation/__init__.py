"""Agents in processes of their own: what they are told, what they may do, and what becomes of them when they fail."""
