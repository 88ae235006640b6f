"""The control step: the interval between two actions, and between two poses of a path."""

CONTROL_STEP = 0.02  # [s]
