"""Folders: hidden names are never listed, and a folder is replaced in one step or not at all."""

from __future__ import annotations

import ast
import ctypes
import errno
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from dextron_bench.storage import folders

ROOT = Path(__file__).parents[2]
MAY_LIST = {  # Modules that list folders themselves, and why hidden names do no harm there.
    "dextron_bench/storage/folders.py": "the home of `visible`",
    "dextron_bench/storage/atomic.py": "looks for temporary files",
    "dextron_bench/training/checkpoints.py": "looks for temporary files",
    "dextron_bench/reaches/recorded/release.py": "every file of the release has a known SHA-256",
    "dextron_bench/methods/isolation/": "lists processes, what to hide, and what an agent wrote",
    "dextron_bench/submissions/recording_check.py": "every recording is compared with its episode",
    "dextron_bench/submissions/starter.py": "asks whether a folder is empty",
}
KILLED = """
import errno, os, sys
from pathlib import Path
from dextron_bench.storage import folders
if sys.argv[2] == "renames":
    folders._exchange = lambda first, second: False
if sys.argv[2] == "copies":  # A folder in the image of a container.
    folders._exchange, rename = lambda first, second: False, os.rename
    def refusing(first, second):
        if first == Path(sys.argv[1]):
            raise OSError(errno.EXDEV, "Invalid cross-device link")
        rename(first, second)
    os.rename = refusing
steps = int(sys.argv[3])
def step(event, arguments):
    global steps
    if event in ("open", "os.rename", "shutil.rmtree", "os.mkdir", "shutil.copytree", "ctypes.dlsym", "os.remove"):
        steps -= 1
        if steps < 0:
            os._exit(9)
sys.addaudithook(step)
with folders.replacing(Path(sys.argv[1])) as part:
    (part / "a.txt").write_text("new")
    (part / "b.txt").write_text("new")
"""


def test_hidden_names_are_not_listed(tmp_path: Path):
    root = tmp_path / ".hidden"  # A hidden folder that the caller names is no obstacle.
    for name in ("b/x/c.txt", "a/x/c.txt", ".a.part/x/c.txt", "a/.x.old/c.txt", "a/x/.c.txt"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).touch()
    expected = [root / "a/x/c.txt", root / "b/x/c.txt"]
    assert folders.visible(root, "*/*/c.txt") == folders.visible(root, "**/*.txt") == expected
    assert folders.visible(tmp_path / "none", "*") == []


@pytest.mark.slow
def test_only_one_module_lists_folders():
    def lists(file: Path) -> bool:
        nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        calls = (node.func for node in nodes if isinstance(node, ast.Call))
        names = {call.attr for call in calls if isinstance(call, ast.Attribute)}
        return bool(names & {"glob", "rglob", "iterdir", "listdir", "scandir"})

    files = [file for folder in ("dextron_bench", "baselines") for file in sorted((ROOT / folder).rglob("*.py"))]
    listing = {file.relative_to(ROOT).as_posix() for file in files if lists(file)}
    assert [file for file in sorted(listing) if not file.startswith(tuple(MAY_LIST))] == []


def test_a_folder_changes_in_one_step(tmp_path: Path):
    board = tmp_path / "board"
    with folders.replacing(board) as part:  # There is no folder yet.
        (part / "a.txt").write_text("old")
        assert not board.exists()
    with folders.replacing(board) as part:
        (part / "a.txt").write_text("new")
        (part / "b.txt").write_text("new")
        assert [file.name for file in board.iterdir()] == ["a.txt"]
        assert (board / "a.txt").read_text() == "old"
    assert sorted(file.read_text() for file in board.iterdir()) == ["new", "new"]
    assert os.listdir(tmp_path) == ["board"]


@pytest.mark.parametrize("exchange", [True, False])
def test_an_error_leaves_the_old_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exchange: bool):
    if not exchange:
        monkeypatch.setattr(folders, "_exchange", lambda first, second: False)
    (tmp_path / "board").mkdir()
    with pytest.raises(FileNotFoundError), folders.replacing(tmp_path / "board") as part:
        (part / "a.txt").rename(part / "b.txt")
    with folders.replacing(tmp_path / "board") as part:
        (part / "b.txt").touch()
    assert (os.listdir(tmp_path), os.listdir(tmp_path / "board")) == (["board"], ["b.txt"])


def test_two_processes_do_not_replace_one_folder(tmp_path: Path):
    with folders.replacing(tmp_path / "board") as part:
        (part / "a.txt").touch()
        with (
            pytest.raises(folders.FolderBusy, match="another process is changing"),
            folders.replacing(part.parent / "b"),
        ):
            pass
    assert os.listdir(tmp_path) == ["board"]


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOSYS, errno.EPERM, errno.EXDEV])
def test_folders_that_cannot_be_exchanged_are_renamed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int):
    """EPERM is the answer of an old sandbox of containers to a call that it does not know."""
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: SimpleNamespace(renameat2=lambda *_: -1))
    monkeypatch.setattr(ctypes, "get_errno", lambda: number)
    for content in ("old", "new"):
        with folders.replacing(tmp_path / "board") as part:
            (part / "a.txt").write_text(content)
    assert ((tmp_path / "board/a.txt").read_text(), os.listdir(tmp_path)) == ("new", ["board"])


def test_a_folder_that_cannot_be_renamed_is_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A folder of a container's image, to which overlayfs answers EXDEV."""
    board, rename = tmp_path / "board", os.rename
    (board / "sub").mkdir(parents=True)
    (board / "sub/a.txt").write_text("old")

    def refusing(source: Path, target: Path) -> None:
        if source == board:
            raise OSError(errno.EXDEV, os.strerror(errno.EXDEV))
        rename(source, target)

    monkeypatch.setattr(folders, "_exchange", lambda first, second: False)
    monkeypatch.setattr(os, "rename", refusing)
    with folders.replacing(board) as part:
        (part / "sub/a.txt").write_text("new")
    assert ((board / "sub/a.txt").read_text(), os.listdir(tmp_path)) == ("new", ["board"])


def test_a_replacement_that_was_killed_while_the_old_folder_was_removed_is_taken_back(tmp_path: Path):
    for name in ("board", ".board.old", ".board.part"):
        (tmp_path / name).mkdir()
    (tmp_path / ".board.old/a.txt").write_text("old")
    folders.recover(tmp_path / "board")
    assert os.listdir(tmp_path / "board") == ["a.txt"]


def test_a_copy_keeps_modes_and_links_where_the_file_system_has_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "a/b").mkdir(parents=True)
    (tmp_path / "a/b/run").write_text("x")
    (tmp_path / "a/b/run").chmod(0o755)
    (tmp_path / "a/link").symlink_to("b/run")
    folders.copy_tree(tmp_path / "a", tmp_path / "c")
    assert ((tmp_path / "c/b/run").stat().st_mode & 0o777, os.readlink(tmp_path / "c/link")) == (0o755, "b/run")

    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    for name in ("chmod", "utime"):
        monkeypatch.setattr(os, name, refuse)
    folders.copy_tree(tmp_path / "a", tmp_path / "d")
    assert (tmp_path / "d/b/run").read_text() == "x"


@pytest.mark.slow
@pytest.mark.parametrize("way", ["exchange", "renames", "copies"])
def test_a_process_killed_at_any_step_leaves_the_old_or_the_new_folder(tmp_path: Path, way: str):
    board, steps, code = tmp_path / "board", 0, 9
    seen = set()
    while code == 9:
        with folders.replacing(board) as part:  # Recovers, and puts the old content back.
            (part / "a.txt").write_text("old")
            (part / "b.txt").unlink(missing_ok=True)
        command = [sys.executable, "-c", KILLED, str(board), way, str(steps)]
        code = subprocess.run(command, check=False, cwd=ROOT).returncode
        folders.recover(board)
        seen.add(tuple(sorted((file.name, file.read_text()) for file in folders.visible(board, "*"))))
        steps += 1
    assert code == 0
    assert seen == {(("a.txt", "old"),), (("a.txt", "new"), ("b.txt", "new"))}
    assert steps > 8
