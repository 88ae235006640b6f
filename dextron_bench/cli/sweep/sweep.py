"""`dextron-bench sweep`: tries several settings of a method, and chooses the best on `val` alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import tyro

from dextron_bench.cli.support import flags, pieces
from dextron_bench.cli.support.exit_codes import DONE, EPISODES_FAILED
from dextron_bench.cli.support.method_flags import settings_dict
from dextron_bench.cli.support.output import print_json, print_table, progress_bar
from dextron_bench.cli.sweep.output import in_words

if TYPE_CHECKING:
    from dextron_bench.sweeps.sweep import Sweep as Question
    from dextron_bench.sweeps.sweep import SweepFile
    from dextron_bench.sweeps.trial import Trial


@dataclass(frozen=True)
class Sweep:
    """Try several settings of a method, each as an ordinary run, and choose the best on `val` alone.

    The other settings of the method are flags, as for `run`. The same command continues a sweep that was interrupted,
    and tries failed trials again. No test split is played; `run` plays them for the winner.

    Example: dextron-bench sweep --method mine.py:Mine --grid near=0.04,0.06,0.08 --seed 0 1 2

    Example: dextron-bench sweep --method stopping --grid settings=100,200,400 --reaches real --into scaling.png

    Example: dextron-bench sweep --method rl --preset quick --grid hold=1,20,40 --seed 0 1 2 --cluster local
    """

    method: flags.Method = ""
    grid: tuple[str, ...] = ()
    """Settings with values, such as near=0.04,0.06 hold=1,20: every combination is a trial."""
    search: tuple[str, ...] = ()
    """Settings to draw, from values or ranges, such as near=0.04..0.08 hold=1..40 rate=1e-4..1e-2:log critics=1,2."""
    trials: int = 20
    """How many trials --search makes; a larger number continues the same sweep."""
    sampler: Literal["random", "tpe", "gp"] = "random"
    """How --search draws: at random, or by Optuna's samplers, which learn from earlier trials (extra `sweep`)."""
    sampler_seed: int = 0
    """Seed of the draws."""
    prune: bool = False
    """Stop a training early when its curve on `val` is below the median of at least five trials (extra `sweep`)."""
    seed: tuple[int, ...] = (0,)
    """Seeds of the agent; a trial counts with the mean of all."""
    reaches: flags.Reaches = "synthetic"
    name: str = ""
    """The name of the sweep; by default the method's name and a hash of what is asked."""
    show: bool = False
    """Run nothing: show this sweep, the one of --name, or a list of all."""
    cluster: pieces.Cluster = ""
    """Do the trials of a grid or a random search side by side on a cluster with Ray: on this machine, on the cluster it
    belongs to, or on another one."""
    into: flags.Picture = None
    """Also draw the scores on `val` against the setting that varies, which has numbers, into this file."""
    runs: flags.Runs = flags.RUNS
    threads: flags.Threads = 0
    device: flags.Device = "cpu"
    quiet: flags.Quiet = False
    json: bool = False
    """Print what the sweep's file holds as JSON."""
    method_settings: tyro.conf.Suppress[Any] = None

    def __call__(self) -> int:
        from dextron_bench.sweeps import execution, space
        from dextron_bench.sweeps.sweep import BadSweep, SweepFile, default_name

        if self.show and not (self.grid or self.search):
            return self._show_all() if not self.name else self._print(SweepFile.of(self.runs, self.name))
        if not self.method:
            raise BadSweep("give --method, or --show to see the sweeps in the folder of runs")
        pieces.check_cluster(self.cluster)
        question = self._question()
        file = SweepFile.of(self.runs, self.name or default_name(question))
        self._check_picture(space.as_json(question.space))
        if not self.show:
            if self.cluster:
                self._run_on_cluster(question, file)
            count = question.trials(self.trials)

            def ended(number: int, trial: Trial) -> None:
                if not (self.json or self.quiet):
                    print(f"trial {number + 1} of {count}: {in_words(trial)}", flush=True)

            resources = execution.Resources(
                self.runs, self.threads, self.device, lambda title: progress_bar(title, self.quiet), ended
            )
            execution.execute(question, file, self.trials, resources)
        return self._print(file)

    def _run_on_cluster(self, question: Question, file: SweepFile) -> None:
        """Trains and plays on a cluster what the trials lack; a trial that fails there is left for this process."""
        from dextron_bench.cluster import trials
        from dextron_bench.sweeps import execution
        from dextron_bench.sweeps.sweep import BadSweep

        if not question.trials_are_independent:
            raise BadSweep(
                "with --cluster trials run side by side, and with --sampler tpe or gp and with --prune they depend on "
                "earlier ones: leave those out, or leave out --cluster"
            )
        groups = execution.runs_ahead(question, file, self.trials, self.runs)
        with pieces.connected(self.cluster, self.runs, self.threads) as cluster:
            with progress_bar("epochs", self.quiet) as progress:
                groups = trials.train(cluster, groups, self.runs, self.device, progress)
            with progress_bar("pieces", self.quiet) as progress:
                trials.play(cluster, groups, self.runs, progress)

    def _question(self) -> Question:
        """What the flags ask."""
        from dextron_bench.cli.sweep import space as sweep_space
        from dextron_bench.sweeps.sweep import BadSweep, Sweep

        space = sweep_space.parse(self.method_settings, self.grid, self.search)
        if self.grid and self.sampler != "random":
            raise BadSweep("--grid tries every combination; --sampler goes with --search")
        if self.trials < 1 or self.sampler_seed < 0:
            raise BadSweep("--trials is 1 or more, and --sampler-seed 0 or more")
        fixed = {name: value for name, value in settings_dict(self.method_settings).items() if name not in space}
        seeds = tuple(dict.fromkeys(self.seed))
        sampler = "grid" if self.grid else self.sampler
        return Sweep(self.method, self.reaches, space, seeds, fixed, sampler, self.sampler_seed, self.prune)

    def _print(self, file: SweepFile) -> int:
        """Prints a sweep; the exit code says whether the agent raised errors."""
        from dextron_bench.cli.sweep import output as sweep_output
        from dextron_bench.sweeps.trial import FAILED, Trial

        content = file.read()
        trials = [Trial.from_json(trial) for trial in content["trials"]]
        if self.into is not None:
            self._check_picture(content["question"]["space"])
            sweep_output.draw(content, trials, self.into)
        if self.json:
            print_json(content)
        else:
            sweep_output.print_trials(file, content, trials, self.runs)
            sweep_output.print_winner(content, trials, self.runs)
        return EPISODES_FAILED if any(trial.failed or trial.state == FAILED for trial in trials) else DONE

    def _check_picture(self, space: Mapping[str, Any]) -> None:
        """Raises UnknownFormat or BadSweep if the scores over this space cannot be drawn into the file."""
        if self.into is None:
            return
        from dextron_bench.scores.figures import pictures
        from dextron_bench.sweeps.sweep import BadSweep

        pictures.check_format(self.into)
        values = [value for part in space.values() for value in part.get("values", ())]
        if len(space) != 1 or not all(type(value) in (int, float) for value in values):
            raise BadSweep("--into draws the scores against one setting with numbers; vary one, as in near=0.04,0.06")

    def _show_all(self) -> int:
        """Prints a row for each sweep."""
        from dextron_bench.sweeps.sweep import sweep_files
        from dextron_bench.sweeps.trial import ENDED

        rows = []
        for file in sweep_files(self.runs):
            content = file.read()
            winner = content["winner"]
            score = content["trials"][winner["trial"]]["val"]["return"]["mean"] if winner else None
            ended = sum(trial["state"] in ENDED for trial in content["trials"])
            rows.append([file.name, content["question"]["method"], ended, winner["run"] if winner else "", score])
        if self.json:
            names = ("sweep", "method", "ended", "winner", "return")
            print_json([dict(zip(names, row, strict=True)) for row in rows])
        else:
            cells = [[*row[:4], "" if row[4] is None else f"{row[4]:.2f}"] for row in rows]
            print_table(f"sweeps in {self.runs}", ["sweep", "method", "trials ended", "winner", "return on val"], cells)
        return DONE
