"""`dextron-bench windows`: draws when closing works on settings of a split, and when agents close there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_table, progress_bar
from dextron_bench.cli.support.rows import NoRows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dextron_bench.evaluation.closing_windows import Choice, Window
    from dextron_bench.methods.agents import Agent
    from dextron_bench.splits.loading import Split
    from dextron_bench.splits.rows import Rows
    from dextron_bench.storage.progress import Progress

EXPERT = "expert"


@dataclass(frozen=True)
class Windows:
    """Draw when closing works on settings of a split, and when agents and each setting's expert close.

    Every setting is played with an opening hand. Near the bottle the episode is forked at each second control step, and
    the fork closes to its end. Agents play the same settings, without forks.

    Example: dextron-bench windows reflex runs/stopping/real/seed0/weights.safetensors --reaches real
    """

    agents: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="AGENT")] = ("reflex",)
    """Methods, labels with shipped weights, module:Class, file.py:Class, or files of weights."""
    reaches: flags.Reaches = "synthetic"
    split: str = "val"
    """The split."""
    rows: int = 20
    """How many settings of it, from the first."""
    failed: bool = False
    """Show only the settings of these in which one of the agents fails."""
    into: Annotated[Path, tyro.conf.arg(metavar="FILE.png|svg|pdf")] = Path("figures/windows.png")
    """The file for the picture."""
    threads: flags.Threads = 0
    quiet: flags.Quiet = False

    def __call__(self) -> int:
        from dextron_bench.scores.figures import episodes, pictures
        from dextron_bench.splits.loading import load_split

        if self.rows < 1:
            raise NoRows(f"--rows must be 1 or more, not {self.rows}")
        pictures.check_format(self.into)
        split, agents = load_split(self.reaches, self.split), dict(map(self._agent, self.agents))
        with progress_bar("windows", self.quiet) as progress:
            windows, choices = self._play(split.first(self.rows), agents, progress)
        self.into.parent.mkdir(parents=True, exist_ok=True)
        title = f"When closing works, and when agents close: {self.split} of {self.reaches} reaches"
        episodes.windows(windows, choices, title, self.into)
        _print(split, windows, choices)
        print(self.into)
        return DONE

    def _play(
        self, rows: Rows, agents: Mapping[str, Agent], progress: Progress
    ) -> tuple[dict[int, Window], dict[str, list[Choice]]]:
        """The window of each row that is shown, by row, and the choices of the expert and of each agent in all rows."""
        from dextron_bench.evaluation import closing_windows
        from dextron_bench.experts.policies import ExpertAgent
        from dextron_bench.reaches.sources import open_source

        source, players = open_source(self.reaches), {EXPERT: ExpertAgent(), **agents}
        choices: dict[str, list[Choice]] = {}
        for number, (name, agent) in enumerate(players.items()):
            progress(number, 1 + len(players), name)
            choices[name] = closing_windows.play_choices(agent, source, rows, self.threads)
        shown = _failed([choices[name] for name in agents]) if self.failed else range(len(rows))
        progress(len(players), 1 + len(players), "forked openings")
        windows = closing_windows.play_windows(source, rows.rows(shown), self.threads)
        return dict(zip(shown, windows, strict=True)), choices

    def _agent(self, name: str) -> tuple[str, Agent]:
        """The label and the agent of a name."""
        from dextron_bench.methods import weights
        from dextron_bench.storage import tensors

        if name.endswith(weights.SUFFIX):
            file = Path(name)
            return tensors.read_about(file).get("label", name), weights.load_agent_from_file(file)
        return weights.agent_by_name(name, self.reaches)


def _failed(choices: Sequence[Sequence[Choice]]) -> Sequence[int]:
    """The rows in which some agent failed; raises NoRows if there is none."""
    rows = list(zip(*choices, strict=True))
    failed = [row for row, chosen in enumerate(rows) if not all(choice.success for choice in chosen)]
    if not failed:
        raise NoRows(f"no agent failed in any of the {len(rows)} settings; leave out --failed, or give more --rows")
    return failed


def _print(split: Split, windows: Mapping[int, Window], choices: Mapping[str, Sequence[Choice]]) -> None:
    """A row for each setting: the first and the last moment that works, and the choices; a failure has an `x`.

    The last line counts in how many of these settings some closing works, and in how many the agents succeed.
    """
    rows = []
    for row, window in windows.items():
        working = window.times[window.works]
        span = f"{working[0]:.2f} to {working[-1]:.2f}" if working.size else "never"
        cells = [f"{one[row].time:.2f}{'' if one[row].success else ' x'}" for one in choices.values()]
        rows.append([row, split.case(row).setting.reach, span, *cells])
    columns = ["row", "reach", "closing works [s]", *(f"{name} [s]" for name in choices)]
    print_table(f"{split.name} of {split.reaches} reaches, version {split.digest[:8]}", columns, rows)
    solvable = sum(bool(window.works.any()) for window in windows.values())
    successes = [f"{name} in {sum(one[row].success for row in windows)}" for name, one in choices.items()]
    print(f"some closing works in {solvable} of {len(windows)} settings; success: {', '.join(successes)}")
