"""`dextron-bench run`: trains a method, evaluates it, records episodes and prints its rows."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE, EPISODES_FAILED
from dextron_bench.cli.support.method_flags import settings_dict
from dextron_bench.cli.support.output import print_json, print_table, print_warning, progress_bar
from dextron_bench.cli.support.pieces import PieceFlags, Pieces, connected, play_on
from dextron_bench.cli.support.standings import print_beside_published

TrackerName = Literal["rerun", "tensorboard", "trackio", "wandb"]

if TYPE_CHECKING:
    from dextron_bench.runs import plans
    from dextron_bench.runs.evaluation_job import EvaluationJob


@dataclass(frozen=True)
class Run:
    """Run a method on the splits of a source of reaches, and print it beside the published rows.

    A method that learns is trained first, with all seeds together. The settings of a method are flags too:
    `dextron-bench run --method rlil --help` shows them. Nothing that a run folder already holds is computed again:
    the same command continues an interrupted run.

    Example: dextron-bench run --method rlil --dur 0.1 --preset smoke --reaches synthetic --seed 0 1 2
    """

    method: flags.Method = "exp"
    all: bool = False
    """Run every method of the paper's table instead of one; --preset then applies to all methods with training."""
    reaches: flags.Reaches = "synthetic"
    split: flags.EvalSplits = ()
    track: tuple[str, ...] = ()
    """Also evaluate on these splits under tracks, such as delay-100 or sensing-1 (docs/splits.md)."""
    seed: tuple[int, ...] = (0,)
    """Seeds of the agent."""
    record: int = 1
    """How many episodes of each split to record, from the first."""
    tracker: tuple[TrackerName, ...] = ()
    """Show the training in these trackers while it runs (docs/following.md)."""
    live: bool = False
    """Show the training in Rerun's viewer while it runs."""
    runs: flags.Runs = flags.RUNS
    threads: int = 0
    """Threads of the simulation; 0 means one per processor, and on a cluster one for each piece. The results do not
    depend on it."""
    device: flags.Device = "cpu"
    pieces: Pieces = field(default_factory=PieceFlags)
    dry_run: bool = False
    """Only print what is left to do and an estimate of the time."""
    quiet: flags.Quiet = False
    json: bool = False
    """Print the rows as JSON."""
    method_settings: tyro.conf.Suppress[Any] = None

    def __call__(self) -> int:
        if self.tracker:
            from dextron_bench.tracking import packages

            packages.require(self.tracker)
        self.pieces.check()
        groups = self._groups()
        if self.dry_run:
            return self._estimate(groups)
        if self.pieces.cluster:
            self._play_on_cluster(groups)
        elif self.pieces.play(lambda: self._jobs(groups), self.runs, self.threads, self.quiet):
            return DONE
        return self._execute(groups)

    def _jobs(self, groups: list[list[plans.Run]]) -> list[EvaluationJob]:
        from dextron_bench.runs import execution

        return [execution.prepare(run, self.runs, self.threads) for group in groups for run in group]

    def _play_on_cluster(self, groups: list[list[plans.Run]]) -> None:
        """Trains and plays on a cluster what the folder of runs lacks."""
        from dextron_bench.cluster import trainings

        with connected(self.pieces.cluster, self.runs, self.threads) as cluster:
            with progress_bar("epochs", self.quiet) as progress:
                trainings.train(cluster, groups, self.runs, self.device, progress)
            play_on(cluster, self._jobs(groups), self.quiet)

    def _groups(self) -> list[list[plans.Run]]:
        """The runs of each method, one for each seed."""
        from dextron_bench.methods import registry
        from dextron_bench.runs.plans import Plan, beside_other_code, resolve, with_tracks

        settings = settings_dict(self.method_settings)
        methods = registry.paper_methods(self.method_settings.preset) if self.all else [(self.method, settings)]
        plans = [Plan(spec, self.reaches, self.split, 0, self.record, flags) for spec, flags in methods]
        runs = [beside_other_code(resolve(plan), self.runs) for plan in plans]
        runs = [with_tracks(run, self.track) for run in runs]
        return [[run.with_seed(seed) for seed in dict.fromkeys(self.seed)] for run in runs]

    def _execute(self, groups: list[list[plans.Run]]) -> int:
        from dextron_bench.runs import annotations, execution, result_files

        results = []
        for group in groups:
            with (
                annotations.noting_failure([run.folder(self.runs) for run in group]),
                self._following(group),
                progress_bar(f"{group[0].label}, epochs", self.quiet) as progress,
            ):
                execution.train(group, self.runs, self.threads, self.device, progress)
            for run in group:
                with (
                    annotations.noting_failure([run.folder(self.runs)]),
                    progress_bar(f"{run.label}, seed {run.seed}", self.quiet) as progress,
                ):
                    folder = execution.execute(run, self.runs, self.threads, progress)
                results.append(result_files.read_result(run.folder(self.runs).result))
                if run.plan.record and not self.json:
                    print(f"{folder}: results, provenance and recordings; open one with `dextron-bench view {folder}`")
        if not print_beside_published(results, {name for group in groups for name in group[0].splits}, self.json):
            return DONE
        self._print_failures(groups)
        return EPISODES_FAILED

    def _print_failures(self, groups: list[list[plans.Run]]) -> None:
        """Says on stderr why episodes failed, and how many for each reason."""
        from dextron_bench.runs import run_files
        from dextron_bench.scores import cells

        for group in groups:
            for why, count in run_files.failures(run.folder(self.runs) for run in group).items():
                episodes = cells.counted(count, "episode")
                print_warning(f"{episodes} of {group[0].label} failed: {why}; `dextron-bench check` tests an agent")

    def _following(self, group: list[plans.Run]) -> AbstractContextManager[None]:
        """Trackers follow the trainings of a group, in processes of their own."""
        names = [*dict.fromkeys(self.tracker), *(["live"] if self.live else [])]
        job = group[0].training_job(self.runs)
        if names and job is None:
            print_warning(f"{group[0].label} does not train, so there is nothing to follow")
        if not names or job is None:
            return nullcontext()
        from dextron_bench.tracking import launch
        from dextron_bench.training.checkpoints import Checkpoints

        seeds = [run.seed for run in group]
        folders = job.training_folders(seeds)
        if any(Checkpoints(folder, ()).is_locked for folder in folders):
            return nullcontext()  # The process that trains there has its trackers; this one says that it is there.
        is_over = all(job.run_folder(seed).weights.exists() for seed in seeds)
        grace = launch.PATIENCE if is_over else launch.GRACE
        return launch.following(folders, names, print_warning, grace)

    def _estimate(self, groups: list[list[plans.Run]]) -> int:
        from dextron_bench.runs.estimates import estimate

        rows = estimate(groups, self.runs, self.threads, self.device)
        if self.json:
            print_json([asdict(row) for row in rows])
            return DONE
        cells = [
            [row.what, row.method, row.reaches, " ".join(map(str, row.seeds)), row.left, time_text(row.seconds)]
            for row in rows
        ]
        print_table("left to do", ["what", "method", "reaches", "seeds", "left", "time"], cells)
        return DONE


def time_text(seconds: float | None) -> str:
    """An estimated time as text."""
    if seconds is None:
        return "unknown"
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
