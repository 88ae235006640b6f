"""Digests of byte strings and of files."""

from __future__ import annotations

import hashlib
from pathlib import Path

from dextron_bench.storage import hashing


def test_a_digest_depends_on_where_parts_end():
    by_hand = hashlib.sha256(b"\x02" + bytes(7) + b"ab" + b"\x01" + bytes(7) + b"c").hexdigest()
    assert hashing.digest(b"ab", b"c") == by_hand
    assert hashing.digest(b"a", b"bc") != by_hand
    assert hashing.digest(b"abc") != by_hand


def test_the_hash_of_a_file_is_the_hash_of_its_content(tmp_path: Path):
    (tmp_path / "a").write_bytes(b"abc")
    assert hashing.sha256(tmp_path / "a") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
