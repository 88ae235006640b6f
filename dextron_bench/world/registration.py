"""Tells Gymnasium of the environments when a program imports it, so that `import dextron_bench` itself stays quick.

Gymnasium 1 finds no plugins by itself: `import dextron_bench`, or the id `dextron_bench:dextron_bench/Grasp-v0`,
makes it know them.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

GYMNASIUM = "gymnasium"


def register() -> None:
    """Registers the environments; imports Gymnasium, and the world only when one is made."""
    import gymnasium

    gymnasium.register(
        "dextron_bench/Grasp-v0",
        entry_point="dextron_bench.world.gym:GraspEnv",
        vector_entry_point="dextron_bench.world.gym:GraspVectorEnv",
    )


def register_with_gymnasium() -> None:
    """Registers at once where Gymnasium is imported already, else right after its first import."""
    if GYMNASIUM in sys.modules:
        register()
    else:
        sys.meta_path.insert(0, _AfterImport())


class _AfterImport(MetaPathFinder):
    """Leaves the import of Gymnasium to the other finders, and registers when it is done."""

    def __init__(self) -> None:
        self._asking = False

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The spec of Gymnasium, with registration appended to its execution; None for any other module."""
        if fullname != GYMNASIUM or self._asking:
            return None
        self._asking = True
        try:
            spec = importlib.util.find_spec(fullname)
        finally:
            self._asking = False
        if spec is None or spec.loader is None:
            return None
        execute = spec.loader.exec_module

        def execute_and_register(module: ModuleType) -> None:
            execute(module)
            sys.meta_path.remove(self)
            register()

        spec.loader.exec_module = execute_and_register
        return spec
