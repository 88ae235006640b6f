"""`dextron-bench success explain`: draws the predictions of the success model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_table, print_warning
from dextron_bench.cli.support.rows import first
from dextron_bench.cli.support.success_models import load_model

if TYPE_CHECKING:
    from dextron_bench.splits.rows import Rows
    from dextron_bench.success.exemplars import PredictedEpisode


@dataclass(frozen=True)
class Explain:
    """Draw the predictions of a success model in five kinds of episodes that the command selects (paper, Fig. 5).

    Example: dextron-bench success explain --reaches synthetic --policies runs/*/synthetic/seed*/weights.safetensors
    """

    reaches: flags.RankedReaches = "synthetic"
    model: Annotated[Path | None, tyro.conf.arg(metavar="FILE.safetensors")] = None
    """The model; by default the model of the data set with seed 0 in --runs, or the shipped one."""
    split: str = "test"
    """The split that experts and policies play."""
    rows: int = 100
    """How many settings of it to play, from the first."""
    policies: flags.Policies = ()
    """Weights of the policies whose episodes to choose from."""
    into: Path = Path("figures/fig5.png")
    """The file for the picture."""
    runs: flags.Runs = flags.RUNS
    threads: flags.Threads = 0

    def __call__(self) -> int:
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.scores.figures.episodes import ridges
        from dextron_bench.splits.loading import load_split
        from dextron_bench.success import exemplars

        model, source = load_model(self.model, self.runs, self.reaches), open_source(self.reaches)
        rows = first(load_split(self.reaches, self.split), self.rows)
        policies = {str(policy): weights.load_agent_from_file(policy) for policy in self.policies}
        chosen = exemplars.choose(exemplars.play_and_predict(model, source, rows, policies, self.threads))
        self.into.parent.mkdir(parents=True, exist_ok=True)
        ridges({exemplars.KINDS[kind]: episode for kind, episode in chosen.items()}, self.into)
        _print_exemplars(chosen, rows)
        if missing := [title for kind, title in exemplars.KINDS.items() if kind not in chosen]:
            print_warning(f"no episode of this kind: {'; '.join(missing)}")
        print(self.into)
        return DONE


def _print_exemplars(chosen: Mapping[str, PredictedEpisode], played: Rows) -> None:
    columns = ["kind", "player", "row", "reach", "return", "cause", "correct steps [%]"]
    numbers = {case.setting: row for row, case in enumerate(played.cases)}
    rows = []
    for kind, predicted in chosen.items():
        episode = predicted.episode
        case = numbers[episode.setting], episode.setting.reach
        outcome = episode.score, predicted.diagnosis.cause, 100 * predicted.accuracy
        rows.append([kind, predicted.player, *case, *outcome])
    print_table("episodes", columns, rows)
