"""Times of an episode: the interval between two actions, which is that of a path's poses, and the longest episode."""

CONTROL_STEP = 0.02  # [s]
STEP_LIMIT = 500  # Control steps in an episode: 10 s.
