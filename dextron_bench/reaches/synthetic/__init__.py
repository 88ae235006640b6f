"""Synthetic reaches: the model, its fit, and a two-sample test against recorded ones."""
