"""Agents in processes of their own: what they are told, what they may do, and what becomes of them when they fail."""

from dextron_bench.isolation.agent import AgentDown, Isolated, Limits, launch

__all__ = ["AgentDown", "Isolated", "Limits", "launch"]
