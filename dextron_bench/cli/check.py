"""`dextron-bench check`: verifies that an agent can be submitted."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.method_flags import changed_settings
from dextron_bench.cli.support.output import print_json


@dataclass(frozen=True)
class Check:
    """Try an agent on a few episodes, in a separate process as for a submission, and list what to fix.

    AGENT is the name of a method, module:Class, file.py:Class, FILE.pt (TorchScript), FILE.onnx, or 'exec:COMMAND' for
    a program that implements the protocol. The settings of a class are flags too, after its name, as for `run`.

    Example: dextron-bench check my_agent/agent.py:MyAgent
    """

    agent: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="AGENT")]
    """The agent; see above for its forms."""
    reaches: flags.RankedReaches = "synthetic"
    weights: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """Weights of a trained method."""
    timeout: float = 10.0
    """Time limit for one answer [s]."""
    memory: float = 4.0
    """Memory limit of the agent [GiB]."""
    threads: flags.Threads = 0
    trust: bool = False
    """Run a policy's file (TorchScript, ONNX) even without a sandbox, with all your rights."""
    json: bool = False
    """Print the results of the checks as JSON."""
    method_settings: tyro.conf.Suppress[Any] = None

    def __call__(self) -> int:
        from dextron_bench.methods.isolation.isolated_agent import Limits
        from dextron_bench.methods.isolation.launch import prepare_launch
        from dextron_bench.submissions import conformance, entry

        settings = entry.whole_settings(self.agent, changed_settings(self.method_settings), self.reaches)
        launch = prepare_launch(self.agent, settings, self.weights, self.trust)
        limits = Limits(answer=self.timeout, memory=int(self.memory * 2**30))
        results = []
        for check in conformance.checks(launch, self.reaches, limits, self.threads):
            results.append(check)
            if not self.json:
                print(f"{check.verdict:4}  {check.what}: {check.detail}", flush=True)
        failed = [check for check in results if check.verdict == conformance.MEND]
        if self.json:
            print_json([{"what": check.what, "verdict": check.verdict, "found": check.detail} for check in results])
        else:
            print(f"{len(failed)} to fix" if failed else f"ready: {self.submission()}")
        return DIFFERS if failed else DONE

    def submission(self) -> str:
        """The command that submits what was checked, with each flag of both commands that is not the default."""
        from dextron_bench.methods import registry

        words = ["dextron-bench", "submit", self.agent]
        for name, value in changed_settings(self.method_settings).items():
            words += shlex.split(registry.as_flag(name, value))
        for name in ("reaches", "weights", "timeout", "memory"):
            if (value := getattr(self, name)) != getattr(Check, name):
                words += [f"--{name}", str(value)]
        words += ["--trust"] if self.trust else []
        return f"{shlex.join(words)} --name NAME"
