"""`dextron-bench view`: opens the right recordings, and makes those that are missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest
import rerun as rr

from dextron_bench import recording
from dextron_bench.cli import main
from dextron_bench.storage import tables
from dextron_bench.success import network
from dextron_bench.web.local_server import LocalServer, Request
from tests.helpers import fixed_success_model

NOTHING = "runs/nothing/synthetic/seed0"


@pytest.fixture
def here(two_runs: Path) -> Path:
    return two_runs


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The files that the viewer receives; the viewer itself would need a screen."""
    shown: list[str] = []

    def view(files: Sequence[Path]) -> None:
        assert all(file.is_file() for file in files)
        shown.extend(str(file) for file in files)

    monkeypatch.setattr(recording, "view", view)
    return shown


@pytest.mark.slow
def test_without_a_filter_all_existing_recordings_are_opened(here: Path, opened: list[str]):
    assert main.main(["view"]) == 0
    assert main.main(["view", "runs/exp/synthetic/seed0"]) == 0
    both = [f"runs/exp/synthetic/seed0/recordings/test-000{row}.rrd" for row in (0, 1)]
    assert main.main(["view", both[0]]) == 0
    assert opened == [*both, *both, both[0]]
    assert not (here / NOTHING / "recordings").exists()


def test_the_worst_and_the_best_are_opened_together_and_listed(
    here: Path, opened: list[str], capsys: pytest.CaptureFixture[str]
):
    capsys.readouterr()
    assert main.main(["view", "--worst", "1", "--best", "1", "--quiet"]) == 0
    assert opened == [f"{NOTHING}/recordings/test-0000.rrd", "runs/exp/synthetic/seed0/recordings/test-0000.rrd"]
    printed = capsys.readouterr()
    assert [word in printed.out for word in ("nothing", "exp", "solved", "return")] == [True] * 4
    assert printed.err == ""
    recorded = recording.read(here / opened[0])
    assert recorded.properties["method"] == "nothing"
    row = pd.read_parquet(here / NOTHING / "episodes.parquet").iloc[0]
    assert (recorded.episode.score, len(recorded.episode.actions)) == (row["score"], row["length"])


@pytest.mark.slow
def test_print_lists_the_files(here: Path, opened: list[str], capsys: pytest.CaptureFixture[str]):
    capsys.readouterr()
    words = ["--failed", "--print", "--method", "nothing", "--split", "test", "--reaches", "synthetic", "--seed", "0"]
    assert main.main(["view", ".", *words]) == 0
    printed = capsys.readouterr()
    assert (opened, printed.err) == ([], "")
    assert printed.out.splitlines() == [f"{NOTHING}/recordings/test-000{row}.rrd" for row in (0, 1)]
    assert main.main(["view", "--runs", "runs", "--row", "1", "--print"]) == 0
    assert [line.split("/")[1] for line in capsys.readouterr().out.splitlines()] == ["exp", "nothing"]


def test_the_browser_opens_all_files_together(
    here: Path,
    opened: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    complaint: Callable[..., str],
):
    answers: dict[str, tuple[int, str, bytes]] = {}

    def serve(server: LocalServer) -> None:
        for path in ("/", "/recordings/0.rrd", "/recordings/1.rrd", "/recordings/2.rrd", "/viewer/", "/other"):
            response = server.site.respond(Request(path, {}, "127.0.0.1:1"))
            answers[path] = (
                (404, "", b"")
                if response is None
                else (response.status, response.headers.get("Location", ""), response.body)
            )

    monkeypatch.setattr(LocalServer, "serve_forever", serve)
    monkeypatch.setattr(recording, "web_viewer_files", lambda: {"index.html": ("text/html", b"viewer")})
    capsys.readouterr()
    assert main.main(["view", "runs/exp", NOTHING, "--row", "0", "--web", "--port", "0", "--quiet"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("http://127.0.0.1:")
    first, second = (f"http%3A%2F%2F127.0.0.1%3A1%2Frecordings%2F{n}.rrd" for n in (0, 1))
    assert answers["/"] == (303, f"/viewer/?url={first}&url={second}", b"")
    files = [Path(folder) / "recordings/test-0000.rrd" for folder in ("runs/exp/synthetic/seed0", NOTHING)]
    assert [answers[f"/recordings/{n}.rrd"][2] for n in (0, 1)] == [file.read_bytes() for file in files]
    assert answers["/viewer/"] == (200, "", b"viewer")
    assert (answers["/recordings/2.rrd"][0], answers["/other"][0]) == (404, 404)
    assert opened == []
    assert "--live shows its window on a screen" in complaint("view", "runs/exp", "--live", "--web")


@pytest.mark.slow
def test_damaged_recordings_are_listed_and_the_others_are_opened(
    here: Path, opened: list[str], capsys: pytest.CaptureFixture[str]
):
    assert main.main(["view", "--quiet", "--split", "test"]) == 0
    first, *others = list(opened)
    opened.clear()
    content = bytearray(Path(first).read_bytes())
    content[len(content) // 2] ^= 1
    Path(first).write_bytes(content)
    capsys.readouterr()
    assert main.main(["view", "runs"]) == 1
    assert opened == others
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"dextron-bench: {first}: ")
    assert "damaged" in line  # By the SHA-256 of the file, or by a check that finds the changed bit first.


def test_a_line_explains_how_to_select_all_matching_episodes(
    here: Path, opened: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    from dextron_bench.catalogue import selection

    monkeypatch.setattr(selection, "LIMIT", 1)
    assert main.main(["view", "--split", "test"]) == 0
    assert "4 episodes match; these are the first 1, --worst 4 selects all" in capsys.readouterr().err
    assert len(opened) == 1


def test_an_error_is_one_line(here: Path, opened: list[str], complaint: Callable[..., str]):
    assert "no recordings at data" in complaint("view", "data")
    assert "nowhere does not exist" in complaint("view", "nowhere")
    assert "is no .rrd file" in complaint("view", NOTHING + "/episodes.parquet")
    assert "no runs at data to select episodes from" in complaint("view", "data", "--failed")
    assert "choose from exp, nothing" in complaint("view", "--method", "bc")
    assert "select 1 episode or more" in complaint("view", "--worst", "0")
    assert "0 of 4 episodes match the filter" in complaint("view", "--failed", "--method", "exp")
    file = "runs/exp/synthetic/seed0/recordings/test-0000.rrd"
    assert "is a file, and episodes are selected from runs" in complaint("view", file, "--worst", "1")
    table = here / NOTHING / "episodes.parquet"
    tables.write(table, pd.read_parquet(table).drop(columns="actions"))  # As earlier versions wrote it.
    assert "its actions were not kept; remove" in complaint("view", "--method", "nothing", "--quiet")
    table.write_bytes(b"")
    assert f"{NOTHING}/episodes.parquet is damaged" in complaint("view", "--worst", "1")
    assert opened == []


@pytest.mark.slow
def test_two_runs_appear_side_by_side_on_a_row_that_only_one_solves(here: Path, opened: list[str]):
    assert main.main(["view", "--diff", "runs/exp", NOTHING]) == 0
    assert opened == ["runs/pairs/exp-0--nothing-0--test-0000.rrd"]
    assert main.main(["view", "--diff", "runs/exp", NOTHING, "--row", "1"]) == 0
    assert opened[1] == "runs/pairs/exp-0--nothing-0--test-0001.rrd"
    files = ["runs/exp/synthetic/seed0/recordings/test-0000.rrd", f"{NOTHING}/recordings/test-0000.rrd"]
    assert main.main(["view", "--diff", *files]) == 0
    assert len(opened) == 3


def test_an_impossible_pair_is_one_line(here: Path, complaint: Callable[..., str]):
    assert "--diff takes two places" in complaint("view", "--diff", "runs/exp")
    assert "no episode has row 7" in complaint("view", "--diff", "runs/exp", NOTHING, "--row", "7")


@pytest.mark.slow
def test_a_policy_plays_live(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], complaint: Callable[..., str]
):
    @contextmanager
    def open_live_viewer() -> Iterator[tuple[Callable[[rr.RecordingStream], None], Callable[[], int]]]:
        yield lambda stream: stream.save(here / "live.rrd"), lambda: 0

    monkeypatch.setattr(recording, "open_live_viewer", open_live_viewer)
    monkeypatch.setattr(network, "shipped_model", lambda reaches: fixed_success_model.model(0.5))
    capsys.readouterr()
    assert main.main(["view", "--live", "--method", "nothing", "--row", "1", "--speed", "0"]) == 0
    assert capsys.readouterr().out == "nothing on row 1 of test: 0 of 20\n"
    assert (here / "live.rrd").stat().st_size > 100_000
    assert "takes the folder of a training, or one --method" in complaint("view", "--live")
    assert "--speed is -1.0; it must be 0 or more" in complaint("view", "--live", "--method", "exp", "--speed", "-1")
    assert "has rows 0 to 1, not 9" in complaint("view", "--live", "--method", "nothing", "--row", "9")
    assert "no weights of 'rl' ship for synthetic reaches and seed 7" in complaint(
        "view", "--live", "--method", "rl", "--seed", "7"
    )
    assert "test of synthetic reaches has rows 0 to 1, not 9" in complaint(
        "view", "--live", "--method", "exp", "--row", "9"
    )
