"""Commands that are interrupted while they write files, and go on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from dextron_bench.cli.support.exit_codes import INTERRUPTED
from dextron_bench.storage import atomic

EVERY = 10  # Files that are written between interruptions.


class Interruptions:
    """Interrupts a command at every tenth file that it writes; `written` counts the files."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.written = 0
        self._write = atomic.write_atomically
        monkeypatch.setattr(atomic, "write_atomically", self._interrupting)

    def finish(self, run: Callable[[], int]) -> None:
        """Runs a command again and again until it is not interrupted; it must end well, after an interruption."""
        codes = [run()]
        while codes[-1] == INTERRUPTED and len(codes) < 50:
            codes.append(run())
        assert codes[0] == INTERRUPTED
        assert codes[-1] == 0

    def _interrupting(self, file: Path, content: Callable[[Path], object]) -> None:
        self.written += 1
        if self.written % EVERY == 0:
            raise KeyboardInterrupt
        self._write(file, content)
