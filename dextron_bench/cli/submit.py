"""`dextron-bench submit`: try an agent on all that a submission needs, and write its bundle."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from dextron_bench.cli.leaderboard import print_rows
from dextron_bench.cli.output import progress_bar
from dextron_bench.cli.run import EPISODES_FAILED
from dextron_bench.leaderboard.submission.declaration import Declaration

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Submit:
    """Play every episode that ranks methods with an agent in a process of its own, and write one bundle (a zip).

    AGENT is a method's name, module:Class, file.py:Class, FILE.pt (TorchScript), FILE.onnx, or 'exec:COMMAND' for a
    program that speaks the protocol. What was played already is not played again.

    Example: dextron-bench submit my_agent/agent.py:MyAgent --name my-agent
    """

    agent: tyro.conf.Positional[str]
    """Which agent: see above."""
    name: str
    """What its row on the leaderboard is called."""
    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    seed: tuple[int, ...] = (0, 1, 2)
    """Seeds of the agent; one is enough where nothing in it is drawn at random."""
    weights: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """Weights of a method that learns."""
    into: Path | None = None
    """The bundle; by default NAME-REACHES.zip here."""
    record: int = 1
    """Add recordings (.rrd) of the first so many rows of each split; every episode can be replayed in any case."""
    declared: tyro.conf.OmitArgPrefixes[Declaration] = field(default_factory=Declaration)
    """What only the authors know; nothing checks it."""
    timeout: float = 10.0
    """Seconds that one answer may take."""
    memory: float = 4.0
    """GiB of memory that the agent may take."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    board: Path = Path("leaderboard")
    """Folder of the leaderboard, among whose methods it is shown."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor. Results do not depend on it."""
    quiet: bool = False
    """Show no progress."""
    settings: str = "{}"
    """Settings of a method or class, as JSON, like '{"near": 0.05}'."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard.submission import playing
        from dextron_bench.methods.isolation.isolated_agent import Limits

        entry = self._entry()
        file = self.into or Path(f"{entry.name}-{entry.reaches}.zip")
        limits = Limits(answer=self.timeout, memory=int(self.memory * 2**30))
        with progress_bar(entry.name, self.quiet) as progress:
            folder = playing.compete(entry, self.runs, self.record, limits, self.threads, progress)
        playing.finish(entry, folder, file)
        print_rows(self._standing(folder), as_json=False)
        failures = playing.failures(folder, entry.seeds)
        for why, count in failures.items():
            print(f"{count} episodes failed: {why}")
        print(f"{file}: check it with `dextron-bench leaderboard verify {file}`, then send it in (docs/leaderboard.md)")
        return EPISODES_FAILED if failures else 0

    def _entry(self) -> Any:
        from dextron_bench.leaderboard.submission import entry as submission_entry

        seeds = tuple(dict.fromkeys(self.seed))
        settings = submission_entry.settle(self.agent, self.settings, self.reaches)
        return submission_entry.Entry(self.name, self.agent, self.reaches, seeds, settings, self.weights, self.declared)

    def _standing(self, folder: Path) -> pd.DataFrame:
        """The leaderboard's rows on these reaches, this submission's among them."""
        from dextron_bench.leaderboard import collect
        from dextron_bench.runs import result_files
        from dextron_bench.scores import standings
        from dextron_bench.splits.loading import ranking_splits
        from dextron_bench.storage.run_folder import RunFolder

        own = [result_files.read_result(RunFolder.of_seed(folder, seed).result) for seed in dict.fromkeys(self.seed)]
        others = (each for each in result_files.results(self.board / collect.RESULTS) if each["method"] != self.name)
        rows = standings.table([*own, *(each for each in others if each["reaches"] == self.reaches)])
        return rows[rows["split"].isin(ranking_splits(self.reaches))]
