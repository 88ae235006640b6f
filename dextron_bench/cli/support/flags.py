"""Flags that many commands have, each written once; where several go together, they are a dataclass of this folder.

A command names the flag as the type of its field, so that its own help keeps its order.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro

from dextron_bench.reaches import sources

RUNS, BOARD = Path("runs"), Path("leaderboard")

Runs = Annotated[Path, tyro.conf.arg(help="Folder of all runs.")]
Board = Annotated[Path, tyro.conf.arg(help="Folder of the leaderboard.")]
Quiet = Annotated[bool, tyro.conf.arg(help="Show no progress.")]
Threads = Annotated[
    int,
    tyro.conf.arg(help="Threads of the simulation; 0 means one per processor. The results do not depend on it."),
]
Device = Annotated[
    Literal["cpu", "cuda", "auto"],
    tyro.conf.arg(
        help="The device for training; auto uses a GPU if there is one. The last bits of the weights depend on it."
    ),
]
Reaches = Annotated[sources.SourceName, tyro.conf.arg(help="The source of reaches.")]
RankedReaches = Annotated[sources.RankedSource, tyro.conf.arg(help="The source of reaches.")]
Method = Annotated[
    str,
    tyro.conf.arg(help="The name of a method (see `dextron-bench runs methods`), module:Class or file.py:Class."),
]
EvalSplits = Annotated[
    tuple[str, ...], tyro.conf.arg(help="The splits to evaluate on; by default all splits that rank methods.")
]
RunName = Annotated[
    str,
    tyro.conf.Positional,
    tyro.conf.arg(metavar="RUN", help="The run: its label, or its label and source of reaches, as in rlil-0.1/real."),
]
RunNames = Annotated[
    tuple[str, ...],
    tyro.conf.Positional,
    tyro.conf.arg(metavar="RUN", help="The runs, by label, or by label and source of reaches."),
]
Policies = Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE.safetensors")]
Picture = Annotated[Path | None, tyro.conf.arg(metavar="FILE.png|svg|pdf")]
