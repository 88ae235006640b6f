"""The exit codes of `dextron-bench`."""

DONE = 0
DIFFERS = 1  # A verification or a comparison failed.
USAGE = 2  # Wrong usage or input.
EPISODES_FAILED = 3  # An agent raised an error in some episodes.
BUG = 70  # An unexpected error.
INTERRUPTED = 130
