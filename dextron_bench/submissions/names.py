"""Names of submissions: no name may look like the name of another row."""

from __future__ import annotations

import re
from collections.abc import Iterable

SEPARATORS = re.compile(r"[._+-]+")
SIMILAR = str.maketrans("01i358", "ollesb")  # Characters that look alike in some font count as one.
SIMILAR_PAIRS = (("rn", "m"), ("vv", "w"), ("cl", "d"))
DIGITS = "0123456789"


def appearance(name: str) -> str:
    """What a reader sees of a name: without case and separators, and with one letter for those that look alike."""
    text = SEPARATORS.sub("", name.casefold())
    for pair, letter in SIMILAR_PAIRS:
        text = text.replace(pair, letter)
    return text.translate(SIMILAR)


def imitated(name: str, reserved: Iterable[str]) -> str:
    """The reserved name that a name equals or begins like, as `rlil_0.1`, `exp.` and `OMEGA2` do; empty if none."""
    parts = (SEPARATORS.split(name)[0], SEPARATORS.sub("", name))
    looks = {appearance(text) for part in parts for text in (part, part.rstrip(DIGITS)) if text}
    return next((other for other in reserved if appearance(other) in looks), "")
