"""`dextron-bench browse`: its JSON, its address, and what it says when it cannot start."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from dextron_bench import recording
from dextron_bench.cli import browse, main
from dextron_bench.web.local_server import LocalServer

WORDS = ["--split", "test", "--quiet", "--json", "--record", "0"]


@pytest.fixture
def here(two_runs: Path) -> Path:
    return two_runs


def test_matching_episodes_as_json(here: Path, capsys: pytest.CaptureFixture[str], complaint: Callable[..., str]):
    capsys.readouterr()
    assert main.main(["browse", "--json", "--where", "row == 1 and return == 20"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["method"], row["split"], row["row"], row["run"]) == ("exp", "test", 1, "runs/exp/synthetic/seed0")
    assert "final" not in row
    assert main.main(["browse", "runs/exp", "--json", "--where", "not success"]) == 0
    assert json.loads(capsys.readouterr().out) == []
    assert "there is no column 'final'" in complaint("browse", "--json", "--where", "final == 0")
    assert "no runs at data" in complaint("browse", "data", "--json")


def test_the_address_has_the_expression(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, complaint: Callable[..., str]
):
    monkeypatch.setattr(LocalServer, "serve_forever", lambda server: None)
    monkeypatch.setattr(recording, "web_viewer_files", lambda: {"index.html": ("text/html", b"")})
    monkeypatch.setenv("SSH_CONNECTION", "a b c d")
    capsys.readouterr()
    assert main.main(["browse", "--web", "--port", "0", "--where", "return < 5"]) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("http://127.0.0.1:")
    assert printed.out.endswith("/?where=return+%3C+5\n")
    port = printed.out.split(":")[2].split("/")[0]
    assert f"ssh -N -L {port}:127.0.0.1:{port} HOST" in printed.err
    assert main.main(["browse", "--web", "--port", "0", "--order", "worst first"]) == 0
    assert capsys.readouterr().out.endswith("/?order=worst+first\n")
    assert "no order 'worst'; choose from 'as played', 'worst first'" in complaint(
        "browse", "--json", "--order", "worst"
    )
    assert "cannot read 'return <'" in complaint("browse", "--web", "--where", "return <")


def test_the_native_viewer_needs_a_screen(here: Path, monkeypatch: pytest.MonkeyPatch, complaint: Callable[..., str]):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert "`view --web` and `browse --web` open recordings in the browser" in complaint("browse")


def test_a_viewer_that_ends_at_once_is_an_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    def view(files: list[Path]) -> None:
        raise recording.ViewerError("ended with code 1")

    monkeypatch.setattr(recording, "view", view)
    with pytest.raises(recording.ViewerError, match="ended with code 1"):
        browse._show(tmp_path / "a.rrd")
