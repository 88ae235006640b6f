"""The recordings that the page links to, and the ridge plots of those that explain the success model."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from dextron_bench.reaches import sources
from dextron_bench.recording import Recorded, read_safely, summarise
from dextron_bench.splits import loading as splits
from dextron_bench.success import exemplars as explanation
from dextron_bench.success import network
from dextron_bench.success.exemplars import EXPERT, Foresight

FOLDER = "recordings"  # Beside the leaderboard's.
KINDS = ("success", "failure")
CASE = "case-"


@dataclass(frozen=True, slots=True)
class Shown:
    """A chosen recording: its file's name, which kind it is of, and what it says of itself."""

    file: str
    kind: str
    method: str
    reaches: str
    split: str
    row: int
    score: float
    outcome: str

    @property
    def address(self) -> str:
        """Where it lies for a page in the leaderboard's folder."""
        return f"../{FOLDER}/{quote(self.file)}"


def chosen(folder: Path) -> list[Shown]:
    """The recordings in a folder that are whole and called as `recordings choose` does, sorted by name."""
    found = []
    for each in summarise(sorted(folder.glob("*.rrd"))):
        kind = _kind(each.file.stem)
        if kind and not each.damage:
            told = each.properties
            method, reaches, split = (str(told.get(name, "")) for name in ("method", "reaches", "split"))
            row, score = int(told.get("row", 0)), float(told["episode_return"])
            found.append(Shown(each.file.name, kind, method, reaches, split, row, score, str(told["outcome"])))
    return sorted(found, key=lambda each: each.file)


def by_method(shown: list[Shown]) -> dict[str, list[Shown]]:
    """The successes and failures of each method, successes first."""
    found: dict[str, list[Shown]] = defaultdict(list)
    for each in sorted(shown, key=lambda each: KINDS.index(each.kind) if each.kind in KINDS else len(KINDS)):
        if each.kind in KINDS:
            found[each.method].append(each)
    return found


def ridges(folder: Path, shown: list[Shown]) -> dict[str, Foresight]:
    """What the success model that ships thinks of each case, by its kind in words, in the order of the paper's figure.

    Cases of a split's other version, or of a source without a model, are left out. Raises BrokenRecording.
    """
    cases = {each.kind: each for each in shown if each.kind in explanation.KINDS}
    found = ((kind, cases[kind]) for kind in explanation.KINDS if kind in cases)
    return {explanation.KINDS[kind]: seen for kind, each in found for seen in _foresight(folder / each.file)}


def _foresight(file: Path) -> Iterator[Foresight]:
    """The recording as the model foretells it, nothing where that cannot be."""
    recorded = read_safely(file)
    told = recorded.properties
    reaches, name = str(told.get("reaches")), str(told.get("split"))
    if name not in splits.known(reaches):
        return
    split = splits.load(reaches, name)
    if split.digest == told.get("split_digest") and reaches != "real":  # Recorded reaches may not be here.
        yield _foresee(recorded, split)


def _foresee(recorded: Recorded, split: splits.Split) -> Foresight:
    model, source = network.shipped(split.reaches), sources.open_source(split.reaches)
    case = split.case(int(recorded.properties["row"]))
    method = str(recorded.properties["method"])
    return explanation.foresee(model, source, case, EXPERT if method == "exp" else method, recorded.episode)


def _kind(stem: str) -> str | None:
    """`success` or `failure` of a method, or one of the explanation's KINDS."""
    if stem.startswith(CASE) and stem.removeprefix(CASE) in explanation.KINDS:
        return stem.removeprefix(CASE)
    return next((kind for kind in KINDS if stem.endswith(f"-{kind}")), None)
