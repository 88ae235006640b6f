"""`dextron-bench runs methods`: the methods that `run` and `eval` know by name."""

from __future__ import annotations

from dataclasses import dataclass

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_table


@dataclass(frozen=True)
class Methods:
    """List the methods that are installed, with their descriptions.

    Example: dextron-bench runs methods
    """

    def __call__(self) -> int:
        from dextron_bench.methods import registry

        methods = [(name, registry.describe(name)) for name in registry.installed_methods()]
        print_table("methods", ["name", "description"], methods)
        return DONE
