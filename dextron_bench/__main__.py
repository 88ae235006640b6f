"""`python -m dextron_bench`: the same as the command `dextron-bench`."""

import sys

from dextron_bench.cli.main import main

sys.exit(main())
