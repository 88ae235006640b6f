"""`dextron-bench submit`: plays an agent on all episodes of a submission and writes its bundle."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE, EPISODES_FAILED
from dextron_bench.cli.support.method_flags import changed_settings
from dextron_bench.cli.support.output import progress_bar
from dextron_bench.cli.support.pieces import PieceFlags, Pieces
from dextron_bench.cli.support.standings import print_rows
from dextron_bench.submissions.declaration import Declaration

if TYPE_CHECKING:
    import pandas as pd

    from dextron_bench.runs.evaluation_job import EvaluationJob
    from dextron_bench.submissions.entry import Entry


@dataclass(frozen=True)
class Submit:
    """Play every episode that ranks methods with an agent in a separate process, and write one bundle (a zip).

    AGENT is the name of a method, module:Class, file.py:Class, FILE.pt (TorchScript), FILE.onnx, or 'exec:COMMAND' for
    a program that implements the protocol. The settings of a class are flags too, after
    its name, as for `run`. The same command continues an interrupted submission.

    Example: dextron-bench submit my_agent/agent.py:MyAgent --name my-agent
    """

    agent: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="AGENT")]
    """The agent; see above for its forms."""
    name: str
    """The name of its row on the leaderboard."""
    reaches: flags.RankedReaches = "synthetic"
    seed: tuple[int, ...] = (0, 1, 2)
    """Seeds of the agent; one is enough if the agent uses no random numbers."""
    weights: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """Weights of a trained method."""
    into: Path | None = None
    """The bundle; by default NAME-REACHES.zip in the working folder."""
    record: int = 1
    """How many rows of each split to record (.rrd), from the first; verification replays every episode in any case."""
    declared: tyro.conf.OmitArgPrefixes[Declaration] = field(default_factory=Declaration)
    """What only the authors know; it is not verified."""
    timeout: float = 10.0
    """Time limit for one answer [s]."""
    memory: float = 4.0
    """Memory limit of the agent [GiB]."""
    trust: bool = False
    """Run a policy's file (TorchScript, ONNX) even without a sandbox, with all your rights."""
    runs: flags.Runs = flags.RUNS
    board: Path = Path("leaderboard")
    """Folder of the leaderboard; the printed table has its methods too. Without it: the published leaderboard."""
    threads: int = 0
    """Threads of the simulation; 0 means one per processor, and on a cluster one for each piece. The results do not
    depend on it."""
    pieces: Pieces = field(default_factory=PieceFlags)
    quiet: flags.Quiet = False
    method_settings: tyro.conf.Suppress[Any] = None

    def __call__(self) -> int:
        from dextron_bench.cluster.tasks import BadCluster
        from dextron_bench.methods import specs
        from dextron_bench.methods.isolation.isolated_agent import Limits
        from dextron_bench.runs import run_files
        from dextron_bench.scores import cells
        from dextron_bench.storage.run_folder import RunFolder
        from dextron_bench.submissions import playing

        entry = self._entry()
        file = self.into or Path(f"{entry.name}-{entry.reaches}.zip")
        limits = Limits(answer=self.timeout, memory=int(self.memory * 2**30))
        self.pieces.check()

        def works() -> list[EvaluationJob]:
            if self.pieces.cluster and specs.parse(entry.spec).kind == "command":
                raise BadCluster(f"{entry.spec} lies on this machine alone: use --share on machines that have it")
            return playing.prepare_all(entry, self.runs, self.record, limits, self.threads)

        if self.pieces.play(works, self.runs, self.threads, self.quiet):
            return DONE
        with progress_bar(entry.name, self.quiet) as progress:
            folder = playing.play_entry(entry, self.runs, self.record, limits, self.threads, progress)
        playing.write_bundle(entry, folder, file)
        print_rows(self._standings(folder), as_json=False)
        failures = run_files.failures(RunFolder.of_seed(folder, seed) for seed in entry.seeds)
        for why, count in failures.items():
            print(f"{cells.counted(count, 'episode')} failed: {why}")
        print(
            f"{file}: verify it with `dextron-bench leaderboard verify {file}`, then send it in (docs/leaderboard.md)"
        )
        return EPISODES_FAILED if failures else DONE

    def _entry(self) -> Entry:
        from dextron_bench.submissions import entry as submission_entry

        seeds = tuple(dict.fromkeys(self.seed))
        settings = submission_entry.whole_settings(self.agent, changed_settings(self.method_settings), self.reaches)
        return submission_entry.Entry(
            self.name, self.agent, self.reaches, seeds, settings, self.weights, self.declared, self.trust
        )

    def _standings(self, folder: Path) -> pd.DataFrame:
        """The leaderboard's rows on this source of reaches, with the rows of this submission."""
        from dextron_bench.leaderboard import collect
        from dextron_bench.runs import result_files
        from dextron_bench.scores import standings
        from dextron_bench.splits.loading import ranking_splits
        from dextron_bench.storage.run_folder import RunFolder

        results = [
            result_files.read_result(RunFolder.of_seed(folder, seed).result) for seed in dict.fromkeys(self.seed)
        ]
        published = self.board / collect.RESULTS
        results += [
            result
            for result in result_files.results(published if published.exists() else result_files.published_results())
            if result["method"] != self.name and result["reaches"] == self.reaches
        ]
        rows = standings.table(results)
        return rows[rows["split"].isin(ranking_splits(self.reaches))]
