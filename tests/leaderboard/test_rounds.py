"""Rounds of a tiny board, from the commitments to the ranks, and what cannot be changed afterwards."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.leaderboard import round_entries, rounds
from dextron_bench.splits import fresh
from dextron_bench.splits.loading import Split, cases_from_frame, split_digest
from dextron_bench.storage import tables
from tests.helpers import tiny_benchmark

NAMES = ("test", "unseen-reach")
Refused = Callable[..., str]


def draw(reaches: str, seed: int, engine: object, rows: int, progress: object = None) -> list[Split]:
    """Instead of a search: two settings that an expert solves, with noise that follows from the seed."""
    table = pd.DataFrame([("-", *one) for one in tiny_benchmark.SOLVED], columns=tiny_benchmark.COLUMNS)
    table = table.assign(window=0.0, duration_noise=table["duration_noise"] + seed % 9973 / 2e6)
    cases = tuple(cases_from_frame(table))
    return [Split(name=name, reaches=reaches, digest=split_digest(table), cases=cases) for name in NAMES]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A board with `exp`, `nothing` and `reflex`, which have played a round."""
    with pytest.MonkeyPatch.context() as patch, tiny_benchmark.working_folder(tmp_path_factory.mktemp("round")) as here:
        patch.setattr(fresh, "draw", draw)
        patch.setattr(rounds, "ROWS", 2)
        for method in ("exp", "nothing", "reflex"):
            assert main.main(["run", "--method", method, "--record", "0", "--quiet"]) == 0
        assert main.main(["leaderboard", "build", "--runs", "runs"]) == 0
        _, secret = rounds.announce(here / "leaderboard", rows=2)
        assert main.main(["leaderboard", "round", "--value", secret, "--quiet"]) == 0
        (here / "secret").write_text(secret)
        yield here


@pytest.fixture
def here(played: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that folder as the working folder."""
    shutil.copytree(played, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


def verify(*words: str) -> int:
    return main.main(["leaderboard", "verify", "--all", "--quiet", *words])


def test_the_round_says_what_played_and_ranks_it(here: Path):
    rows = pd.read_csv(here / "leaderboard/table.csv").to_dict("records")
    by_method = {row["method"]: row for row in rows if row["split"] == "test"}
    assert by_method["exp"]["unranked"] == "a ceiling"
    assert by_method["exp"]["score"] == 1.0
    assert by_method["nothing"]["score"] == 0.0
    assert by_method["nothing"]["rank"] >= by_method["reflex"]["rank"] == 1
    assert "| a ceiling | `exp` | 100.0" in (here / "leaderboard/README.md").read_text()
    assert "Round 1 on synthetic reaches" in (here / "leaderboard/index.html").read_text()
    assert not (here / "runs/rounds/1/pieces").exists()


def test_a_round_that_nobody_touched_is_verified(here: Path, capsys: pytest.CaptureFixture[str]):
    assert verify("--redraw") == 0
    assert "round 1: its files agree" in capsys.readouterr().out


def changed(file: Path, column: str, value: str | float) -> None:
    """Changes the last value of a column, and gives the table the digest of its new values."""
    table = pd.read_parquet(file)
    table.attrs = {}
    table.loc[len(table) - 1, column] = value
    tables.write(file, table)


@pytest.mark.parametrize(
    ("column", "value", "problem"),
    [
        ("score", 10.0, "its episodes on unseen-reach of the round differ"),
        ("actions", "0" * 12, "its episodes on unseen-reach of the round differ"),
        ("method", "best", "episodes of best/synthetic, seed 0, do not fit its settings"),
        ("reaches", "real", "episodes of reflex/real, seed 0, do not fit its settings"),
    ],
)
def test_changed_episodes_are_found(
    here: Path, capsys: pytest.CaptureFixture[str], column: str, value: str | float, problem: str
):
    """The last row of the table is one of `reflex`."""
    changed(here / "leaderboard/rounds/1/episodes.parquet", column, value)
    assert verify() in (1, 2)
    printed = capsys.readouterr()
    assert problem in printed.out + printed.err


def test_commitments_that_were_changed_later_are_found(here: Path, capsys: pytest.CaptureFixture[str]):
    file = here / "leaderboard/rounds/1/commitments.json"
    file.write_text(file.read_text().replace('"rows": 2', '"rows": 3'))
    assert verify("--redraw") == 1
    printed = capsys.readouterr().out
    assert "its commitments were changed after its settings were drawn" in printed
    assert "its settings on synthetic reaches do not follow from its beacon" in printed


def test_settings_that_were_changed_are_refused(here: Path, complaint: Refused):
    changed(here / "leaderboard/rounds/1/settings-synthetic.parquet", "offset_x", 0.01)
    assert "its settings are others than draw.json names" in complaint("leaderboard", "verify", "--all", "--quiet")


def test_an_operator_cannot_choose_another_secret(here: Path, complaint: Refused):
    announced, secret = rounds.announce(here / "leaderboard", rows=2)
    assert announced.commitments.beacon == f"operator {hashlib.sha256(secret.encode()).hexdigest()}"
    text = complaint("leaderboard", "round", "--value", "another", "--quiet")
    assert "'another' is not the secret whose hash round 2 has announced" in text
    assert "needs the value of its beacon: operator " in complaint("leaderboard", "round", "--quiet")


def test_a_void_round_stays_and_does_not_count(here: Path, complaint: Refused):
    """The next one can then be announced, and the ranks still follow from the first."""
    assert main.main(["leaderboard", "announce", "--rows", "1"]) == 2
    rounds.announce(here / "leaderboard", "drand, round 5000000", rows=2)
    assert "round 2 is not over" in complaint("leaderboard", "announce", "--rows", "2")
    assert main.main(["leaderboard", "round", "--void", "the beacon was late"]) == 0
    assert "the beacon was late" in (here / "leaderboard/rounds/2/void.json").read_text()
    latest = rounds.latest(here / "leaderboard")
    assert latest is not None
    assert latest.number == 1
    assert "no round of leaderboard is announced" in complaint("leaderboard", "round", "--value", "1")


def test_a_row_that_changes_after_the_announcement_cannot_play(here: Path, complaint: Refused):
    _, secret = rounds.announce(here / "leaderboard", rows=2)
    shutil.rmtree(here / "leaderboard/results/reflex")
    text = complaint("leaderboard", "round", "--value", secret, "--quiet")
    assert "reflex/synthetic is not what round 2 has announced" in text


def test_a_row_that_nobody_ran_again_plays_no_round(here: Path):
    """It has episodes, as a submission, but not the tier `re-run`."""
    rows = round_entries.rows_by_name(here / "leaderboard")["reflex/synthetic"]
    assert round_entries.can_play(rows[0])
    rows[0].run.episodes.touch()
    assert not round_entries.can_play(rows[0])
