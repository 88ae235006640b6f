"""The site of `browse`: searches, pictures, recordings that are made when they are opened, and what it refuses."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from urllib.parse import urlencode

import pandas as pd
import pytest
from PIL import Image

from dextron_bench import recording
from dextron_bench.catalogue.browse import page
from dextron_bench.catalogue.browse.search import Search
from dextron_bench.web.local_server import LOOPBACK, LocalServer
from dextron_bench.world.rendering import renderer

Ask = Callable[..., tuple[HTTPResponse, bytes]]


@pytest.fixture
def ask(server: LocalServer) -> Ask:
    """Sends a request, with a form if there is one, and returns the response and its body."""

    def ask(path: str, form: Mapping[str, str] | None = None, **headers: str) -> tuple[HTTPResponse, bytes]:
        connection = HTTPConnection(LOOPBACK, server.server_port, timeout=120)
        body = None if form is None else urlencode(form)
        connection.request(
            "GET" if form is None else "POST", path, body, {k.replace("_", "-"): v for k, v in headers.items()}
        )
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        return answer, content

    return ask


def key_of(episodes: pd.DataFrame, method: str, row: int = 0) -> str:
    return str(episodes.index[(episodes["method"] == method) & (episodes["row"] == row)][0])


def token(ask: Ask) -> str:
    match = re.search(r'name="token" value="([^"]+)"', ask("/")[1].decode())
    assert match
    return match[1]


@pytest.mark.slow
def test_the_page_shows_the_episodes_that_match(ask: Ask, episodes: pd.DataFrame):
    answer, body = ask("/?" + urlencode({"where": "cause == 'solved' and return == 20", "order": "best first"}))
    text = body.decode()
    assert "2 of 4 episodes" in text
    assert [f'id="e{key}"' in text for key in episodes.index] == [True, True, False, False]
    assert "script" not in answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]


def test_an_expression_that_cannot_be_read_is_explained_on_the_page(ask: Ask):
    text = ask("/?" + urlencode({"where": "caus == '<b>'"}))[1].decode()
    assert "there is no column &#x27;caus&#x27;; did you mean cause?" in text
    assert 'value="caus == &#x27;&lt;b&gt;&#x27;"' in text
    assert "0 of 4 episodes" in text


def test_a_picture_shows_the_last_state(ask: Ask, episodes: pd.DataFrame):
    answer, body = ask(f"/picture/{key_of(episodes, 'exp')}.png")
    assert answer.headers["Content-Type"] == "image/png", ask("/")[1].decode()
    picture = Image.open(io.BytesIO(body)).convert("RGB")
    assert picture.size == (320, 240)
    assert len(set(picture.getdata())) > 50  # pyright: ignore[reportArgumentType]


def test_a_machine_that_cannot_draw_says_so(ask: Ask, episodes: pd.DataFrame, monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object, **__: object) -> None:
        raise renderer.NoGraphics("no <library>")

    monkeypatch.setattr(renderer, "Renderer", fail)
    assert ask(f"/picture/{key_of(episodes, 'exp')}.png")[0].status == 404
    assert "There are no pictures: no &lt;library&gt;" in ask("/")[1].decode()


def test_a_recording_is_made_and_shown(ask: Ask, episodes: pd.DataFrame, runs: Path, shown: list[Path]):
    key, file = key_of(episodes, "nothing"), runs / "nothing/synthetic/seed0/recordings/test-0000.rrd"
    assert not file.exists()
    form = {"token": token(ask), "where": "return < 5", "page": "1"}
    answer, _ = ask(f"/open/{key}", form)
    assert (answer.status, answer.headers["Location"]) == (303, f"/?where=return+%3C+5#e{key}")
    assert shown == [file]
    assert recording.read(file).properties["method"] == "nothing"
    assert ask(f"/recordings/{key}.rrd")[1] == file.read_bytes()
    file.write_bytes(file.read_bytes()[:-30])  # A damaged recording is made again.
    assert ask(f"/open/{key}", form)[0].status == 303
    assert recording.read(file).episode.score == 0.0


@pytest.mark.parametrize("viewer", [{"index.html": ("text/html", b"viewer")}])
def test_the_web_viewer_opens_the_recording_of_this_server(ask: Ask, episodes: pd.DataFrame, server: LocalServer):
    key = key_of(episodes, "exp")
    answer, _ = ask(f"/open/{key}", {"token": token(ask)})
    recording_address = f"http%3A%2F%2F127.0.0.1%3A{server.server_port}%2Frecordings%2F{key}.rrd"
    assert (answer.status, answer.headers["Location"]) == (303, f"/viewer/?url={recording_address}")
    assert ask("/viewer/")[1] == b"viewer"
    assert ask(f"/recordings/{key}.rrd")[1][:4] == b"RRF2"


def test_what_goes_wrong_is_on_the_page(ask: Ask, episodes: pd.DataFrame, runs: Path):
    table = runs / "nothing/synthetic/seed0/episodes.parquet"
    content = table.read_bytes()
    table.write_bytes(b"")
    answer, body = ask(f"/open/{key_of(episodes, 'nothing', 1)}", {"token": token(ask)})
    table.write_bytes(content)
    assert answer.status == 200
    assert "episodes.parquet is damaged" in body.decode()


@pytest.mark.parametrize("form", [{}, {"token": ""}, {"token": "guessed"}, {"token": "gu\xe4ssed"}])
def test_a_form_of_another_site_does_nothing(form: dict[str, str], ask: Ask, episodes: pd.DataFrame, shown: list[Path]):
    assert ask(f"/open/{key_of(episodes, 'exp')}", form)[0].status == 403
    assert shown == []


@pytest.mark.parametrize(
    "path",
    [
        *("/picture/0000000000000000.png", "/picture/../../secret.png", "/recordings/0000000000000000.rrd", "/open/"),
        *("/recordings/..%2f..%2fresult.json", "/viewer/", "/viewer/index.html", "/index.html", "/where"),
    ],
)
def test_nothing_else_is_served(path: str, ask: Ask):
    assert ask(path)[0].status == 404
    assert ask(path, {"token": token(ask)})[0].status == 404


def test_an_episode_without_a_recording_has_no_file(ask: Ask, episodes: pd.DataFrame):
    assert ask(f"/recordings/{key_of(episodes, 'nothing', 1)}.rrd")[0].status == 404


def test_other_sites_and_other_names_are_refused(ask: Ask, episodes: pd.DataFrame, server: LocalServer):
    """A picture that another site embeds would keep this machine busy."""
    picture = f"/picture/{key_of(episodes, 'exp')}.png"
    assert ask(picture, Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="no-cors")[0].status == 403
    assert ask("/", Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="navigate")[0].status == 200
    assert ask("/", Host="evil.example")[0].status == 403
    assert ask(f"/open/{key_of(episodes, 'exp')}", {"token": token(ask)}, Host="evil.example")[0].status == 403
    assert server.server_address[0] == "127.0.0.1"
    assert ask("/open/x", {"token": "x" * 20_000})[0].status == 413


def test_all_that_comes_from_files_is_escaped(episodes: pd.DataFrame):
    hostile = episodes.copy()
    for name in ("method", "split", "cause", "failure", "subject", "run", "reach", "reaches"):
        hostile[name] = '"><script>alert(1)</script>$style'
    text = page.document(hostile, Search("<script>", "as played"), "token", "here", "<script>")
    assert "<script" not in text
    assert text.count("&lt;script&gt;alert(1)") >= 4
