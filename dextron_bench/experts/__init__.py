"""Experts: the class Pi_E of policies and the expert database G_s (paper, II.C)."""
