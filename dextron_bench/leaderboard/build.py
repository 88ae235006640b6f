"""The published leaderboard: results, curves and weights taken over from runs, and what is made of them."""

from __future__ import annotations

import shutil
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.methods import registry as methods
from dextron_bench.methods import weights
from dextron_bench.methods.learners import Learner
from dextron_bench.runs import run_files as records
from dextron_bench.scores import standings as leaderboard
from dextron_bench.splits import loading as splits
from dextron_bench.storage import atomic
from dextron_bench.training.jobs import CURVE

RESULTS = "results"  # In the leaderboard's folder: a folder of runs less their large files.
BEGIN, END = "<!-- made by `dextron-bench leaderboard build`: -->", "<!-- end of what was made -->"
MADE = ("tier", "frames", "demonstrations", "seconds", "hardware", "privileged")
Curves = dict[int, pd.DataFrame]  # By seed; columns epoch, return, success.


class NothingToPublish(LookupError):
    """A folder of runs none of which is finished."""


def take(runs: Path, into: Path) -> list[Path]:
    """Copies results and curves of finished runs into the leaderboard's folder, and weights beside their methods.

    A run is finished when its result holds all rows of all splits that rank methods. Returns the folders of results
    that were written; raises NothingToPublish, DamagedFile, UnknownMethod, BadSettings.
    """
    taken = []
    for file in sorted(runs.glob(f"*/*/seed*/{records.RESULT}")):
        result = records.read_result(file)
        if not _finished(result):
            continue
        place = into / RESULTS / file.parent.relative_to(runs)
        known = place / records.RESULT
        atomic.write_json(known, _checked(result, records.read_result(known)) if known.exists() else result)
        if (found := file.with_name(CURVE)).exists():
            _copy(found, place / CURVE)
        _ship(file.parent, result)
        taken.append(place)
    if not taken:
        raise NothingToPublish(f"no run in {runs} holds all splits that rank methods; `dextron-bench run` makes some")
    return taken


def build(into: Path) -> list[Path]:
    """Makes the table (CSV, JSON), its short form in the README, learning curves and the page from the results.

    The page links to recordings in the folder beside. Returns the files; raises DamagedFile, BrokenRecording.
    """
    from dextron_bench.leaderboard import page
    from dextron_bench.leaderboard.page.showreel import FOLDER
    from dextron_bench.scores import figures

    results = list(records.results(into / RESULTS))
    rows = leaderboard.table(results)
    known = _whole(rows, results)
    made = [into / "table.csv", into / "README.md", into / "table.json"]
    atomic.write_atomically(made[0], lambda part: known.to_csv(part, index=False, float_format="%.6g"))
    atomic.write_atomically(made[2], lambda part: known.to_json(part, orient="records", indent=1))
    curves: dict[str, dict[str, Curves]] = defaultdict(dict)
    for (method, reaches), found in learning_curves(into / RESULTS).items():
        curves[reaches][method] = found
    _insert(made[1], "\n".join(_sections(known, set(curves))))
    for reaches, found in curves.items():
        made.append(into / _picture(reaches))
        figures.learning_curves(found, rows[rows["reaches"] == reaches], made[-1])
    made.append(into / page.FILE)
    text = page.document(rows, results, curves, into.resolve().parent / FOLDER)
    atomic.write_atomically(made[-1], lambda part: part.write_text(text, encoding="utf-8"))
    return made


def _whole(rows: pd.DataFrame, results: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """The leaderboard's rows with how far each was checked and what making it took, the columns MADE."""
    from dextron_bench.leaderboard.page import rows as entries

    told = [each for each in entries.entries(rows, results) if each.tier != entries.QUOTED]
    return rows.assign(**{name: [getattr(each, name) for each in told] for name in MADE})


def learning_curves(runs: Path, cloned: bool = False) -> dict[tuple[str, str], Curves]:
    """The learning curves of runs that live in the world, by method and source of reaches; raises DamagedFile.

    What has no frames has no place on their axis: it is `cloned` from demonstrations.
    """
    found: dict[tuple[str, str], Curves] = defaultdict(dict)
    for file in sorted(runs.glob(f"*/*/seed*/{CURVE}")):
        result = records.read_result(file.with_name(records.RESULT))
        points = pd.DataFrame(atomic.read_json(file)["points"])
        if (result["training"]["frames"] is None) == cloned:
            found[result["method"], result["reaches"]][result["seed"]] = points
    return found


def _finished(result: dict[str, Any]) -> bool:
    wanted = [splits.load(result["reaches"], name) for name in splits.evaluated(result["reaches"])]
    have = {name: (found["digest"], len(found["scores"])) for name, found in result["splits"].items()}
    return all(have.get(split.name) == (split.digest, len(split.cases)) for split in wanted)


def _checked(result: dict[str, Any], before: dict[str, Any]) -> dict[str, Any]:
    """A result with what verification noted in the one before it, where both say the same of every episode."""
    told = [{name: split["scores"] for name, split in each["splits"].items()} for each in (result, before)]
    hashes = [(each.get("training") or {}).get("sha256") for each in (result, before)]
    if told[0] != told[1] or hashes[0] != hashes[1] or "tier" not in before:
        return result
    noted = {name: before["splits"][name].get("actions") for name in result["splits"]}
    parts = {
        name: split | ({"actions": noted[name]} if noted[name] else {}) for name, split in result["splits"].items()
    }
    return {**result, "splits": parts, "tier": before["tier"]}


def _ship(folder: Path, result: dict[str, Any]) -> None:
    """Puts an installed learner's weights where `eval` finds them; those of a file's stay with whose they are."""
    config = atomic.read_json(folder / records.CONFIG)
    if config["code"]["sha256"]:
        return
    method = methods.create(config["code"]["class"], config["settings"])
    if isinstance(method, Learner):  # A method that takes the policy of another has no weights of its own.
        _copy(folder / weights.FILE, weights.place(method, result["reaches"]) / f"seed{result['seed']}.safetensors")


def _copy(file: Path, place: Path) -> None:
    atomic.write_atomically(place, lambda part: shutil.copyfile(file, part))


def _insert(file: Path, text: str) -> None:
    """Puts text between the marks of a file, which is made where it is not there."""
    old = file.read_text(encoding="utf-8") if file.exists() else f"# Leaderboard\n\n{BEGIN}\n{END}\n"
    before, _, rest = old.partition(BEGIN)
    after = rest.partition(END)[2] or "\n"
    new = f"{before.rstrip()}\n\n{BEGIN}\n{text}\n{END}{after}"
    atomic.write_atomically(file, lambda part: part.write_text(new, encoding="utf-8"))


def _picture(reaches: str) -> str:
    """The file of a source's learning curves."""
    return f"curves-{reaches}.png"


def _sections(rows: pd.DataFrame, drawn: set[str]) -> Iterator[str]:
    """The README's tables, as Markdown: for each source, scores on every split, then how episodes of `test` end.

    Ranks are those on `test`. Sources in `drawn` have a picture of learning curves.
    """
    for reaches, group in rows.groupby("reaches", sort=False):
        names = [name for name in splits.NAMES if name in set(group["split"])]
        ranked = group[group["split"] == "test"]["method"].tolist()
        yield f"\n## {reaches} reaches\nMean return of 20 with its 95 % interval, and successes [%].\n"
        yield _line(["rank", "method", "seeds", "tier", *(f"`{name}`" for name in names)])
        yield _line(["---"] * (4 + len(names)))
        for method in ranked:
            own = group[group["method"] == method].set_index("split")
            rank, (seeds, tier) = own["rank"].loc["test"], own[["seeds", "tier"]].iloc[0]
            cells = [f"{rank:.0f}".replace("nan", ""), f"`{method}`", seeds, tier]
            yield _line([*cells, *(_score(own, name) for name in names)])
        if reaches in drawn:
            yield f"\n![Learning curves on {reaches} reaches]({_picture(str(reaches))})"
        yield "\nHow episodes of `test` end [%] ([docs/diagnosis.md](../docs/diagnosis.md)); closing lag in seconds.\n"
        yield _line(["method", *CAUSES, "closing lag"])
        yield _line(["---", *["---:"] * (len(CAUSES) + 1)])
        for row in group[group["split"] == "test"].to_dict("records"):
            shares = [f"{100 * row[cause] / row['episodes']:.1f}" for cause in CAUSES]
            lag = "" if pd.isna(row["closing_lag"]) else f"{row['closing_lag']:.2f}"
            yield _line([f"`{row['method']}`", *shares, lag])


def _score(own: pd.DataFrame, split: str) -> str:
    if split not in own.index:
        return ""
    row = own.loc[split]
    low, high = f"{row['return_low']:.2f}", f"{row['return_high']:.2f}"
    return f"{row['return']:.2f} [{low}, {high}], {100 * row['success']:.1f} %"


def _line(cells: list[Any]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"
