"""Training: the loop around a learner, its checkpoints and its learning curve."""
