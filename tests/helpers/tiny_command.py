"""`dextron-bench` with the splits of the tiny benchmark: `python tests/helpers/tiny_command.py DATA WORD ...`.

DATA is a folder with the splits, as `tiny_benchmark.write` makes it. If there is none, it is made, with `train`.
"""

import signal
import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).parents[2])
signal.signal(signal.SIGINT, signal.default_int_handler)

from dextron_bench.cli.main import main  # noqa: E402
from tests.helpers import tiny_benchmark, tiny_training  # noqa: E402

data = Path(sys.argv.pop(1))
if not data.exists():
    tiny_training.write(data)
tiny_benchmark.install(data)
sys.exit(main())
