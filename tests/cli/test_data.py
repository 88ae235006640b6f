"""`dextron-bench data` in a process: results on stdout, one line on stderr, exit codes."""

from __future__ import annotations

import errno
import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from dextron_bench.cli import main
from dextron_bench.cli.commands import COMMANDS, Group
from dextron_bench.reaches.recorded import cache as recorded_cache
from dextron_bench.reaches.recorded import release
from tests.helpers.small_release import SmallRelease

FILE, NOTES = "extracts/01_fl_06.json", "extracts/meta/01_fl_06_meta.json"
INJECT = """
import sys
from pathlib import Path
from dextron_bench.reaches.recorded import release
release.SHIPPED = Path(sys.argv.pop(1))
from dextron_bench.cli.main import main
sys.exit(main())
"""  # The command line with another manifest instead of the shipped one.


def run(small_release: SmallRelease, *arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs the command line, by default with an empty cache."""
    words, streams = list(map(str, arguments)), (io.StringIO(), io.StringIO())
    manifest = release.Manifest.load(small_release.manifest)
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(streams[0]), redirect_stderr(streams[1]):
        for name in [name for name in os.environ if name.startswith("DEXTRON_")]:
            patch.delenv(name)
        for name, value in {"DEXTRON_CACHE": str(small_release.folder / "cache"), **environment}.items():
            patch.setenv(name, value)
        patch.setattr(release.Manifest, "load", lambda: manifest)
        try:
            code = main.main(words)
        except SystemExit as ended:
            code = int(ended.code or 0)
    return subprocess.CompletedProcess(words, code, *(stream.getvalue() for stream in streams))


def complaint(done: subprocess.CompletedProcess[str]) -> str:
    """The one line on stderr of a command that ended with code 2 and no result."""
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("dextron-bench: ")
    return done.stderr


def with_line(content: bytes, number: int, line: bytes) -> bytes:
    lines = content.splitlines(keepends=True)
    lines[number - 1] = line
    return b"".join(lines)


@pytest.mark.slow
def test_import_then_info(small_release: SmallRelease):
    done = run(small_release, "data", "import", "--from", small_release.zip())
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("3 reaches imported into ")
    done = run(small_release, "data", "info", "--json")
    groups = json.loads(done.stdout)
    assert [(g["subject"], g["ring"], g["angle"], g["reaches"]) for g in groups] == [
        *(("01", 0, 0, 1), ("01", 1, 1, 1), ("02", 3, 3, 1))
    ]
    assert groups[0]["duration"] == pytest.approx(0.5)  # Six samples, 0.1 s and 0.1 m apart.
    assert groups[0]["length"] == pytest.approx(0.5)
    assert groups[0]["speed"] == pytest.approx(1.0)


DAMAGE = {
    "truncated": (FILE, lambda content: content[:-30], f"{FILE}: line 6: is not JSON"),
    "invalid": (FILE, lambda content: with_line(content, 3, b"oops\n"), f"{FILE}: line 3: is not JSON"),
    "back": (FILE, lambda c: with_line(c, 4, c.splitlines(True)[1]), f"{FILE}: line 4: time goes back"),
    "nan": (FILE, lambda content: content.replace(b"-0.2", b"NaN", 1), f"{FILE}: line 1: 'x' holds nan"),
    "short": (FILE, lambda content: content.replace(b", -0.1]", b"]", 1), f"{FILE}: line 1: 'x' is not 3 numbers"),
    "annotation": (NOTES, lambda content: content.replace(b"reached", b"touched"), f"{NOTES}: line 1: annotation 'rea"),
    "blank": (FILE, lambda content: content + b"\n", f"{FILE}: line 7: is not JSON"),
    "value": (FILE, lambda content: content.replace(b"-0.5", b"-0.6"), f"{FILE}: its SHA-256 is not the published"),
}


QUICK = ("truncated", "value")  # The others are slow, since each starts a process.


@pytest.mark.slow
@pytest.mark.parametrize("kind", [pytest.param(k, marks=[] if k in QUICK else pytest.mark.slow) for k in DAMAGE])
def test_damage_is_one_line_with_file_and_position(small_release: SmallRelease, kind: str):
    file, damage, expected = DAMAGE[kind]
    damaged = small_release.zip({file: damage(small_release.files[file])})
    assert expected in complaint(run(small_release, "data", "import", "--from", damaged))
    assert not (small_release.folder / "cache").exists()


def test_info_without_reaches_explains_how_to_get_them(small_release: SmallRelease):
    line = complaint(run(small_release, "data", "info"))
    assert "data import --from" in line
    assert "data fetch" in line


def test_info_reads_the_release_in_the_environment_variable(small_release: SmallRelease):
    done = run(small_release, "data", "info", DEXTRON_DATA=str(small_release.zip()))
    assert (done.returncode, done.stderr) == (0, "")
    assert "3 real reaches by subject" in done.stdout


def test_fetch_without_network_suggests_an_import(small_release: SmallRelease):
    line = complaint(run(small_release, "data", "fetch", https_proxy="http://127.0.0.1:9", no_proxy=""))
    assert "cannot download https://github.com/" in line
    assert "data import --from" in line


def test_a_cache_that_cannot_be_made_is_one_line(small_release: SmallRelease):
    blocked = str(small_release.manifest / "cache")
    line = complaint(run(small_release, "data", "import", "--from", small_release.zip(), DEXTRON_CACHE=blocked))
    assert "Not a directory" in line
    assert blocked in line


def test_debug_raises_the_error(monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(FileNotFoundError):
        main.main(["data", "import", "--debug", "--from", "/none"])
    monkeypatch.setenv("DEXTRON_DEBUG", "1")
    with pytest.raises(FileNotFoundError):
        main.main(["data", "import", "--from", "/none"])


@pytest.mark.parametrize(
    "arguments", [["nosuch"], ["data", "nosuch"], ["data", "info", "--nosuch"], ["data", "import"], []]
)
def test_wrong_usage_is_code_2(arguments: list[str], capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as caught:
        main.main(arguments)
    assert caught.value.code == 2
    assert capsys.readouterr().out == ""


def test_every_command_has_an_example(capsys: pytest.CaptureFixture[str]):
    for name, command in COMMANDS.items():
        group = command if isinstance(command, Group) else Group("", {}, command)
        for inner in [*([[]] if group.command else []), *([member] for member in group.members)]:
            with pytest.raises(SystemExit) as caught:
                main.main([name, *inner, "--help"])
            assert caught.value.code == 0
            assert f"Example: dextron-bench {' '.join([name, *inner])}" in capsys.readouterr().out


def test_help_imports_nothing_heavy():
    script = "import sys; from dextron_bench.cli import main; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert not {"torch", "mujoco", "scipy", "pandas", "matplotlib", "rerun", "pyarrow"} & set(loaded)


@pytest.mark.slow
def test_a_pipe_that_closes_early_is_no_error(small_release: SmallRelease):
    run(small_release, "data", "import", "--from", small_release.zip())
    command = [sys.executable, "-c", INJECT, str(small_release.manifest), "data", "info"]
    environment = {**os.environ, "DEXTRON_CACHE": str(small_release.folder / "cache")}
    pipe = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert pipe.stdout is not None
    pipe.stdout.close()
    assert pipe.stderr is not None
    assert pipe.stderr.read() == b""
    assert pipe.wait() == 0


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (OSError(errno.ENOSPC, "No space left on device", "runs/a"), 2, "No space left on device: runs/a"),
        (recorded_cache.MissingData(), 2, "the recorded reaches have not been imported"),
        (ModuleNotFoundError("No module named 'ray'"), 2, "No module named 'ray'"),
        (TypeError("two\nlines"), 70, "unexpected TypeError: two lines"),
    ],
)
def test_every_error_has_its_exit_code(
    error: BaseException,
    code: int,
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(recorded_cache, "import_release", fail)
    assert main.main(["data", "import", "--from", "x"]) == code
    assert capsys.readouterr().err.startswith(f"dextron-bench: {line}")


def test_a_source_is_drawn(small_release: SmallRelease, tmp_path: Path):
    from dextron_bench.reaches.setting import ReachSource
    from dextron_bench.scores.figures.pictures import UnknownFormat
    from dextron_bench.scores.figures.reaches import reach_paths

    reaches = release.read(small_release.zip(), release.Manifest.load(small_release.manifest))
    reach_paths(ReachSource("real", reaches), tmp_path / "reaches.png")
    assert (tmp_path / "reaches.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(UnknownFormat, match=r"choose from \.pdf, \.png, \.svg"):
        reach_paths(ReachSource("real", reaches), tmp_path / "reaches.doc")
