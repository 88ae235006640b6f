"""A container, whose first process has the number 1, like the first process of every other container."""

import os

os.getpid = lambda: 1
