"""`python -m tools.fit_synthetic`: fits the model of synthetic reaches to the recorded ones again."""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import tyro

from dextron_bench.cli.support.exit_codes import DONE, USAGE
from dextron_bench.cli.support.output import progress_bar
from dextron_bench.storage import home


@dataclass(frozen=True)
class Fit:
    """Fit the model of synthetic reaches to the recorded ones again, and compare it with the shipped model.

    Example: python -m tools.fit_synthetic --into synthetic-reaches.npz
    """

    seed: int = 0
    """Seed of the fit; the shipped model has seed 0."""
    into: Annotated[Path, tyro.conf.arg(metavar="FILE.npz")] = Path("synthetic-reaches.npz")
    """The file for the parameters."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from importlib.resources import files

        from dextron_bench.reaches.recorded import cache
        from dextron_bench.reaches.synthetic import fitting, parameters
        from dextron_bench.storage import atomic

        if self.seed < 0:
            raise ValueError(f"--seed is {self.seed}; it must be 0 or more")
        shipped = files("dextron_bench").joinpath("data/synthetic-reaches.npz").read_bytes()
        with progress_bar("models fitted", self.quiet) as progress, TemporaryDirectory() as folder:
            model = fitting.fit(cache.load_reaches(), self.seed)
            progress(1, 1)
            file = Path(folder) / "model.npz"
            parameters.save(model, file)
            content = file.read_bytes()
        into = home.expanded(self.into)
        atomic.write_atomically(into, lambda part: part.write_bytes(content))
        print(f"{into}: {len(content):,} bytes, {compared(content, shipped)}")
        return DONE


def compared(content: bytes, shipped: bytes) -> str:
    """How a file of parameters differs from the shipped one, as text."""
    import numpy as np

    if content == shipped:
        return "byte for byte the shipped file"
    with np.load(io.BytesIO(content)) as new, np.load(io.BytesIO(shipped)) as old:
        pairs = {name: (new[name].astype(float), old[name].astype(float)) for name in old.files}
    if other := [name for name, (a, b) in pairs.items() if a.shape != b.shape]:
        return f"not the shipped file: {', '.join(other)} have another shape"
    total = sum(a.size for a, _ in pairs.values())
    differ = sum(int((a != b).sum()) for a, b in pairs.values())
    if not differ:
        return "all numbers are as in the shipped file, but the bytes differ"
    distances = {name: float(abs(a - b).max() / abs(b).max()) for name, (a, b) in pairs.items()}
    worst = max(distances, key=distances.__getitem__)
    return (
        f"not the shipped file: {differ:,} of {total:,} numbers differ, by at most {distances[worst]:.1g} of the "
        f"largest in their array ({worst})"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code; `arguments` default to `sys.argv`."""
    try:
        return tyro.cli(Fit, prog="python -m tools.fit_synthetic", args=arguments)()
    except (LookupError, ValueError, OSError) as error:
        print(f"fit_synthetic: {error}", file=sys.stderr)
        return USAGE


if __name__ == "__main__":
    sys.exit(main())
