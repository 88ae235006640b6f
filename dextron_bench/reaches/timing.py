"""Times of an episode: the interval between two actions, as between two poses of a path, and the longest episode."""

CONTROL_STEP = 0.02  # [s]
STEP_LIMIT = 500  # Control steps in an episode: 10 s.
