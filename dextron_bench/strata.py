"""Groups of a split's rows by which scores are told apart: the subject who reached, and where the hand started."""

from __future__ import annotations

import pandas as pd

from dextron_bench.splits import Split
from dextron_bench.world import raw, sources


def strata(split: Split) -> pd.DataFrame:
    """A row for each of the split's, in order: `subject`, `ring` 0 (near) to 3 (far), `angle` 0 (-x) to 3 (-y).

    The recorded reaches' names say this, so that a table of them needs none of the recordings. Raises UnknownReach.
    """
    names = [case.setting.reach for case in split.cases]
    if split.reaches == "real":
        rows = [raw.origin(name) for name in names]
    else:
        source = sources.open_source(split.reaches)
        found = [source.stratum(name) for name in names]
        rows = [(each.subject, each.ring, each.angle) for each in found]
    return pd.DataFrame(rows, columns=["subject", "ring", "angle"])
