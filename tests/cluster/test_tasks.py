"""What is sent to a node and comes back, without Ray: inputs, versions, errors, and the files that are written."""

from __future__ import annotations

import errno
import os
import pwd
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.cli import main
from dextron_bench.cluster import inputs, installation, ray_cluster, worker
from dextron_bench.cluster.tasks import BadCluster, ResultFile, Task, content_hash, write_files
from dextron_bench.storage import atomic
from tests.helpers.immediate_cluster import ImmediateCluster, performed


def double(runs: Path, threads: int, name: str) -> Sequence[Path]:
    """Writes a file twice as long as the input of that name, and names the input among its results."""
    text = (runs / name).read_text()
    (runs / "out").mkdir()
    (runs / "out/doubled").write_text(f"{text}{text} {threads} {os.environ.get('DEXTRON_CACHE', '')}")
    return [runs / name, runs / "out/doubled"]


def fail(runs: Path, threads: int) -> Sequence[Path]:
    """Raises an error that has an unusual constructor, and so cannot be pickled."""
    raise atomic.DamagedFile(runs / "table", "it is short")


def threads_of_libraries(runs: Path, threads: int) -> Sequence[Path]:
    """Writes the numbers of threads that PyTorch and a library that is loaded later use."""
    import torch

    (runs / "threads").write_text(f"{torch.get_num_threads()} {os.environ['OMP_NUM_THREADS']}")
    return [runs / "threads"]


@pytest.fixture(autouse=True)
def own_temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "node").mkdir()
    monkeypatch.setattr(worker.tempfile, "tempdir", str(tmp_path / "node"))
    for name in (*worker.THREAD_VARIABLES, "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, "1")


def test_inputs_arrive_once_and_only_new_files_come_back(tmp_path: Path):
    (tmp_path / "weights").write_text("ab")
    inputs = {"runs/in/weights": tmp_path / "weights", "cache/reaches": tmp_path / "weights"}
    task = Task("a", double, {"name": "in/weights"}, inputs, threads=1)
    (file,) = performed(task).files
    text, count, cache = file.content.decode().split()
    assert (file.path, text, count, Path(cache).name) == ("out/doubled", "abab", "1", "cache")
    assert "DEXTRON_CACHE" not in os.environ or os.environ["DEXTRON_CACHE"] != cache
    stored = list((tmp_path / "node").rglob(content_hash(b"ab")))
    assert len(stored) == 1
    stored[0].write_text("damaged")
    assert performed(task).files[0].content.startswith(b"abab")
    assert not list((tmp_path / "node").glob("dextron-task-*"))


def test_a_reused_process_has_the_threads_of_its_task():
    counts = [performed(Task("a", threads_of_libraries, {}, threads=count)).files[0].content for count in (2, 1)]
    assert counts == [b"2 2", b"1 1"]


@pytest.mark.parametrize("name", ["code", "data", "mujoco", "Python"])
def test_another_version_does_nothing(name: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(worker.pickle, "loads", lambda content: pytest.fail("unpickled a task of another version"))
    reply = performed(Task("a", fail, {}), {**installation.version(), name: "other"})
    assert reply.is_refusal
    assert f"differs in {name}; install the same on all nodes" in reply.error


def test_an_error_of_the_work_comes_back_in_words():
    reply = performed(Task("a", fail, {}))
    assert "table is damaged (it is short); remove it and run again" in reply.error
    assert "DamagedFile" in reply.traceback
    assert not reply.is_refusal
    other = performed(Task("a", double, {"name": "missing"}))
    assert other.error.startswith("FileNotFoundError: ")


def test_files_are_written_in_order_until_one_has_other_bytes(tmp_path: Path):
    good, bad = ResultFile("a/table", content_hash(b"x"), b"x"), ResultFile("a/stamp", content_hash(b"y"), b"z")
    with pytest.raises(atomic.DamagedFile, match="arrived with other bytes"):
        write_files([good, bad], tmp_path)
    assert [file.name for file in (tmp_path / "a").iterdir()] == ["table"]


def test_the_flag_is_checked_before_any_work(complaint: Callable[..., str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(ray_cluster.importlib.util, "find_spec", lambda name: object())
    for words in (["data", "mc"], ["run"], ["success", "data"], ["submit", "reflex", "--name", "x"]):
        assert "'nearby' is none of local, auto and ray://HOST:PORT" in complaint(*words, "--cluster", "nearby")
        assert "leave out --share and --merge" in complaint(*words, "--cluster", "local", "--merge")
    assert "need --all" in complaint("leaderboard", "verify", "some.zip", "--cluster", "local")


def test_without_ray_the_flag_says_what_to_install(complaint: Callable[..., str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(ray_cluster.importlib.util, "find_spec", lambda name: None)
    for words in (["data", "mc"], ["run"], ["success", "data"], ["leaderboard", "verify", "--all"]):
        text = complaint(*words, "--cluster", "local")
        assert text == "dextron-bench: --cluster needs Ray: `pip install 'dextron-bench[cluster]'`\n"


def test_a_piece_of_a_lost_node_is_done_before_new_ones(tmp_path: Path):
    cluster = ImmediateCluster("local", tmp_path / "runs")
    cluster.losing = {"b": 2}
    counts: list[tuple[int, int]] = []
    tasks = [Task(name, threads_of_libraries, {}) for name in "abcd"]
    cluster.run_all(tasks, lambda done, total, note="": counts.append((done, total)))
    assert cluster.order == ["a", "b", "c", "b", "d", "b"]
    assert list(dict.fromkeys(counts)) == [(0, 4), (1, 4), (2, 4), (3, 4), (4, 4)]
    assert counts.count((3, 4)) > 1  # Reported again while the last piece is under way.


def test_a_content_is_stored_once_until_others_crowd_it_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(inputs, "KEPT", 2)
    stored: list[bytes] = []
    references = inputs.References(lambda content: stored.append(content) or f"reference {len(stored)}")
    for name, content in (("a", "A"), ("same", "A"), ("b", "B")):
        (tmp_path / name).write_text(content)
    assert [references.reference(tmp_path / name) for name in ("a", "same", "b", "a")] == [
        *("reference 1", "reference 1", "reference 2", "reference 1")
    ]
    (tmp_path / "b").write_text("longer")
    assert references.sha256(tmp_path / "b") == content_hash(b"longer")
    assert references.reference(tmp_path / "b") == "reference 3"
    (tmp_path / "b").write_text("B")
    assert references.reference(tmp_path / "b") == "reference 4"
    assert stored == [b"A", b"B", b"longer", b"B"]


def test_a_large_task_fits_no_small_node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    class Ray:
        @staticmethod
        def nodes() -> list[dict[str, Any]]:
            return [{"Alive": True, "Resources": {"CPU": 2.0}}, {"Alive": False, "Resources": {"CPU": 64.0}}]

    monkeypatch.setattr(ray_cluster.importlib.util, "find_spec", lambda name: object())
    for threads, room in ((1, 4), (2, 2)):
        cluster = ray_cluster.RayCluster("local", tmp_path, threads)
        monkeypatch.setattr(cluster, "_ray", Ray, raising=False)
        assert cluster._room() == room
    cluster.threads = 4
    with pytest.raises(BadCluster, match="a task needs 4 processors, and the largest node has 2"):
        cluster._room()


def test_help_is_quick_because_it_imports_no_ray(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        main.main(["data", "mc", "--help"])
    assert "--cluster local|auto|ray://HOST:PORT" in " ".join(capsys.readouterr().out.split())


def test_a_node_of_a_user_without_a_name_has_a_folder(monkeypatch: pytest.MonkeyPatch):
    def unknown(*_: object) -> str:
        raise KeyError("getpwuid(): uid not found: 12345")

    for name in ("LOGNAME", "USER", "LNAME", "USERNAME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    assert worker._node_folder().name == f"dextron-bench-{os.getuid()}"


def test_tasks_share_nothing_where_there_are_no_symbolic_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "symlink", refuse)
    worker._link_computed(tmp_path)
    assert not list(tmp_path.glob(worker.COMPUTED))


@pytest.mark.parametrize("home", [None, "/proc"])
def test_ray_gets_a_token_where_it_cannot_write_one(monkeypatch: pytest.MonkeyPatch, home: str | None):
    for name in ray_cluster.TOKENS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: home or path)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with ray_cluster._token_without_home():
        assert len(os.environ["RAY_AUTH_TOKEN"]) == 64
    assert "RAY_AUTH_TOKEN" not in os.environ


def test_ray_writes_its_own_token_into_a_home_that_can_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("RAY_AUTH_TOKEN", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    with ray_cluster._token_without_home():
        assert "RAY_AUTH_TOKEN" not in os.environ
