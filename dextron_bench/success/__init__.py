"""The success model: from what a hand does in a state, the chance that the grasp succeeds (paper, II.E)."""
