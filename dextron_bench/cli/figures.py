"""`dextron-bench figures`: draws the paper's figures from shipped data and published results."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.rows import NoRows


@dataclass(frozen=True)
class Figures:
    """Draw the paper's figures 3, 4 and 5, and the README's pictures.

    Figure 3 shows the start points of solvable settings, and all reaches. Figure 4 shows learning curves of the methods
    that train in the simulated world, of the success model, and of behaviour cloning. Figure 5 shows the predictions of
    the success model in five kinds of episodes; the command plays and selects these episodes again.

    Example: dextron-bench figures --reaches synthetic --into figures
    """

    reaches: flags.RankedReaches = "synthetic"
    into: Path = Path("figures")
    """The folder for the pictures."""
    board: Path = flags.BOARD
    """Leaderboard with the learning curves of figures 4a and 4c; without it, these are left out."""
    rows: int = 3000
    """Maximum number of points in figure 3a."""
    settings: int = 100
    """How many settings of `test` the experts and the shipped policies play for figure 5."""
    threads: flags.Threads = 0

    def __call__(self) -> int:
        from dextron_bench.recording import stills

        if min(self.rows, self.settings) < 1:
            raise NoRows("--rows and --settings must be 1 or more")
        self.into.mkdir(parents=True, exist_ok=True)
        for file in (*self._reaches(), *self._learning(), *self._success(), *stills.write_pictures(self.into)):
            print(file)
        return DONE

    def _file(self, name: str) -> Path:
        return self.into / f"{name}-{self.reaches}.png"

    def _reaches(self) -> Iterator[Path]:
        from dextron_bench.experts import database
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.scores.figures import reaches
        from dextron_bench.splits.near_equal import SETTING

        source = open_source(self.reaches)
        solved = database.load_shipped(self.reaches)[0].query("score == 20")
        solved = solved.drop_duplicates(SETTING).head(self.rows)
        reaches.start_points(source, solved, self._file("fig3a"))
        yield self._file("fig3a")
        reaches.reach_paths(source, self._file("fig3b"))
        yield self._file("fig3b")

    def _learning(self) -> Iterator[Path]:
        from dextron_bench.leaderboard import build, collect
        from dextron_bench.runs import result_files
        from dextron_bench.scores import standings
        from dextron_bench.scores.figures.training import learning_curves

        results = self.board / collect.RESULTS
        rows = standings.table(result_files.results(results)) if results.exists() else None
        for name, cloned, epochs in (("fig4a", False, "epochs of 1,000 frames"), ("fig4c", True, "epochs of training")):
            all_curves = build.learning_curves(results, cloned)
            curves = {method: seeds for (method, reaches), seeds in all_curves.items() if reaches == self.reaches}
            if curves and rows is not None:
                source_rows = rows[rows["reaches"] == self.reaches]
                constant = source_rows.head(0) if cloned else source_rows
                learning_curves(curves, constant, self._file(name), epochs)
                yield self._file(name)

    def _success(self) -> Iterator[Path]:
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.scores.figures import episodes as drawn_episodes
        from dextron_bench.scores.figures.training import success_curve
        from dextron_bench.splits.loading import load_split
        from dextron_bench.success import exemplars, network

        success_curve(network.training_info(self.reaches)["curve"], self._file("fig4b"))
        yield self._file("fig4b")
        files = [file for file in weights.all_shipped(self.reaches) if file.stem == "seed0"]
        policies = {file.parts[-3]: weights.load_agent_from_file(file) for file in files}
        model, rows = network.shipped_model(self.reaches), load_split(self.reaches, "test").first(self.settings)
        episodes = exemplars.play_and_predict(model, open_source(self.reaches), rows, policies, self.threads)
        chosen = exemplars.choose(episodes)
        drawn_episodes.ridges({exemplars.KINDS[kind]: episode for kind, episode in chosen.items()}, self._file("fig5"))
        yield self._file("fig5")
