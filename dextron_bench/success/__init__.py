"""The success model Omega: the chance that a grasp succeeds after an action in a state (paper, II.E)."""
