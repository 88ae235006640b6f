"""`dextron-bench figures`: the paper's figures from what ships and what was published."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dextron_bench.cli.success_eval import NoRows


@dataclass(frozen=True)
class Figures:
    """Draw the paper's figures 3, 4 and 5, and the README's pictures.

    3: where settings that can be grasped start, and all reaches. 4: learning curves of the methods that live in the
    world, of the success model, and of those that clone experts. 5: what the success model thinks in five kinds of
    episodes, which are played and found anew.

    Example: dextron-bench figures --reaches synthetic --into figures
    """

    reaches: Literal["real", "synthetic"] = "synthetic"
    """The source of reaches."""
    into: Path = Path("figures")
    """Folder for the pictures."""
    results: Path = Path("leaderboard/results")
    """Results whose learning curves are figures 4a and 4c; where the folder is not there, they are left out."""
    rows: int = 3000
    """Points in figure 3a at most."""
    settings: int = 100
    """Settings of `test` on which figure 5 plays experts and the policies that ship."""
    threads: int = 0
    """Threads of the simulation; 0 takes one for each processor."""

    def __call__(self) -> int:
        from dextron_bench.recording import stills

        if min(self.rows, self.settings) < 1:
            raise NoRows("--rows and --settings are how many are drawn and played, 1 or more")
        self.into.mkdir(parents=True, exist_ok=True)
        for file in (*self._reaches(), *self._learning(), *self._success(), *stills.write_pictures(self.into)):
            print(file)
        return 0

    def _file(self, name: str) -> Path:
        return self.into / f"{name}-{self.reaches}.png"

    def _reaches(self) -> Iterator[Path]:
        from dextron_bench.experts import database
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.scores import figures
        from dextron_bench.splits import building

        source = open_source(self.reaches)
        solved = database.load_shipped(self.reaches)[0].query("score == 20")
        solved = solved.drop_duplicates(building.SETTING).head(self.rows)
        figures.start_points(source, solved, self._file("fig3a"))
        yield self._file("fig3a")
        figures.reach_paths(source, self._file("fig3b"))
        yield self._file("fig3b")

    def _learning(self) -> Iterator[Path]:
        from dextron_bench.leaderboard import build
        from dextron_bench.runs import result_files
        from dextron_bench.scores import figures, standings

        rows = standings.table(result_files.results(self.results)) if self.results.exists() else None
        for name, cloned, epochs in (("fig4a", False, "epochs of 1,000 frames"), ("fig4c", True, "epochs of cloning")):
            found = build.learning_curves(self.results, cloned)
            curves = {method: own for (method, reaches), own in found.items() if reaches == self.reaches}
            if curves and rows is not None:
                own = rows[rows["reaches"] == self.reaches]
                figures.learning_curves(curves, own.head(0) if cloned else own, self._file(name), epochs)
                yield self._file(name)

    def _success(self) -> Iterator[Path]:
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.scores import figures
        from dextron_bench.splits.loading import load_split
        from dextron_bench.success import exemplars, network

        figures.success_curve(network.training_info(self.reaches)["curve"], self._file("fig4b"))
        yield self._file("fig4b")
        files = [file for file in weights.all_shipped(self.reaches) if file.stem == "seed0"]
        policies = {file.parts[-3]: weights.load_agent_from_file(file) for file in files}
        model, cases = network.shipped_model(self.reaches), load_split(self.reaches, "test").cases[: self.settings]
        seen = exemplars.play_and_predict(model, open_source(self.reaches), cases, policies, self.threads)
        chosen = exemplars.choose(seen)
        figures.ridges({exemplars.KINDS[kind]: each for kind, each in chosen.items()}, self._file("fig5"))
        yield self._file("fig5")
