"""A user without a home folder gets one line that says what to do."""

from __future__ import annotations

import pwd
from pathlib import Path

import pytest

from dextron_bench.storage import home


@pytest.fixture
def no_home(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user without a name, as in a container that runs with `-u 12345`."""

    def unknown(number: int) -> None:
        raise KeyError("getpwuid(): uid not found: 12345")

    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)


def test_a_home_is_as_the_system_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert (home.folder("-"), home.expanded(Path("~/a"))) == (tmp_path, tmp_path / "a")


@pytest.mark.usefixtures("no_home")
def test_without_a_home_the_message_says_what_to_do():
    with pytest.raises(home.NoHome, match=r"^this user has no home folder: set X$"):
        home.folder("set X")
    with pytest.raises(home.NoHome, match=r"^the home folder in ~/a is not known: write the whole path$"):
        home.expanded(Path("~/a"))
    assert home.expanded(Path("a/~")) == Path("a/~")
