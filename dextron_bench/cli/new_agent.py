"""`dextron-bench new-agent`: writes a small agent to start from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dextron_bench.cli.support.exit_codes import DONE


@dataclass(frozen=True)
class NewAgent:
    """Write a small working agent and its test into a new folder.

    Example: dextron-bench new-agent my_agent
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """The new folder."""

    def __call__(self) -> int:
        from dextron_bench.submissions import starter

        for file in starter.copy_template(self.folder):
            print(file)
        print(f"try it:    dextron-bench check {self.folder}/agent.py:MyAgent")
        print(f"score it:  dextron-bench run --method {self.folder}/agent.py:MyAgent")
        print(f"submit it: dextron-bench submit {self.folder}/agent.py:MyAgent --name my-agent  (docs/agents.md)")
        return DONE
