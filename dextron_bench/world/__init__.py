"""The simulated world: hand, bottle, task, engine and environments."""
