"""`dextron-bench check`: whether an agent can be submitted, and what to mend."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from dextron_bench.cli.output import print_json

DONE, DIFFERS = 0, 1


@dataclass(frozen=True)
class Check:
    """Try an agent on a few episodes, in a process of its own as when it is submitted, and say what to mend.

    AGENT is a method's name, module:Class, file.py:Class, FILE.pt (TorchScript), FILE.onnx, or 'exec:COMMAND' for a
    program that speaks the protocol.

    Example: dextron-bench check my_agent/agent.py:MyAgent
    """

    agent: tyro.conf.Positional[str]
    """Which agent: see above."""
    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    weights: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """Weights of a method that learns."""
    settings: str = "{}"
    """Settings of a method or class, as JSON, like '{"near": 0.05}'."""
    timeout: float = 10.0
    """Seconds that one answer may take."""
    memory: float = 4.0
    """GiB of memory that the agent may take."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor."""
    json: bool = False
    """Print what was found as JSON."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard.submission import conformance, entry
        from dextron_bench.methods.isolation.isolated_agent import Limits
        from dextron_bench.methods.isolation.launch import prepare_launch

        how = prepare_launch(self.agent, entry.settle(self.agent, self.settings, self.reaches), self.weights)
        limits = Limits(answer=self.timeout, memory=int(self.memory * 2**30))
        found = []
        for check in conformance.checks(how, self.reaches, limits, self.threads):
            found.append(check)
            if not self.json:
                print(f"{check.verdict:4}  {check.what}: {check.found}", flush=True)
        bad = [check for check in found if check.verdict == conformance.MEND]
        if self.json:
            print_json([{"what": each.what, "verdict": each.verdict, "found": each.found} for each in found])
        else:
            ready = f"ready: dextron-bench submit {shlex.quote(self.agent)} --name NAME"
            print(f"{len(bad)} to mend" if bad else ready)
        return DIFFERS if bad else DONE
