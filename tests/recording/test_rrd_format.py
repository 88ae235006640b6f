"""The version of Rerun that wrote a file, and the faults that its first and last bytes show."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench.recording import rrd_format

OPTIONS = b"\1\2\0\0"


def written(file: Path, content: bytes) -> rrd_format.RrdFormat:
    file.write_bytes(content)
    return rrd_format.look_at(file)


@pytest.mark.parametrize(
    ("head", "tail", "writer", "fault"),
    [
        (b"RRF2\0\x1a\2\0", b"\0" * 8, "Rerun 0.26.2", ""),  # As Rerun 0.26.2 writes it: without a footer.
        (b"RRF2\0\x1c\2\0", b"FOOT\1\0\0\0", "Rerun 0.28.2", ""),
        (b"RRF2\0\x1c\2\0", b"\0" * 8, "Rerun 0.28.2", "is cut short: it has no footer"),
        (b"RRF1\0\x13\1\0", b"\0" * 8, "Rerun 0.19.1", "is an .rrd file of another version of Rerun (Rerun 0.19.1"),
    ],
)
def test_bytes_four_to_six_are_the_version_and_only_files_since_0_28_have_a_footer(
    tmp_path: Path, head: bytes, tail: bytes, writer: str, fault: str
):
    form = written(tmp_path / "a.rrd", head + OPTIONS + tail)
    assert form.writer == writer
    assert form.fault.startswith(fault)
    assert bool(form.fault) == bool(fault)


def test_a_decoder_that_fails_proves_damage_only_for_its_own_version(tmp_path: Path):
    older = written(tmp_path / "a.rrd", b"RRF2\0\x16\1\0" + OPTIONS)
    assert (
        older.undecodable("why")
        == f"was written by Rerun 0.22.1, and Rerun {rrd_format.INSTALLED} cannot read it (why)"
    )
    current = bytes([0, int(rrd_format.INSTALLED.partition(".")[2]), 7, 0])
    assert (
        written(tmp_path / "b.rrd", b"RRF2" + current + OPTIONS + b"FOOT\1\0\0\0").undecodable("why")
        == "is damaged (why)"
    )


def test_a_header_that_is_not_whole_is_named(tmp_path: Path):
    assert written(tmp_path / "a.rrd", b"RRF2\0").fault == "is cut short: it has no whole header"
