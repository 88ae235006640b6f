"""The packages that trackers need."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence

from dextron_bench.errors import MissingPackage


def require(names: Sequence[str]) -> None:
    """Raises MissingPackage if the package of a tracker is not installed; imports none of them."""
    missing = [name for name in names if name != "rerun" and not _is_installed(name)]
    if missing:
        raise MissingPackage(
            f"--tracker {missing[0]} needs the package of this name: `pip install {missing[0]}`, "
            f"or the extra: `pip install 'dextron-bench[{missing[0]}]'`"
        )


def _is_installed(name: str) -> bool:
    spec = importlib.util.find_spec(name)
    return spec is not None and spec.origin is not None  # W&B makes folders of its name, which are no packages.
