"""A small release: three made-up reaches, in the same files as the authors' release."""

from __future__ import annotations

import hashlib
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

NAMES = ("01_fl_01", "01_fl_06", "02_nr_16")
START = 3.5  # [s] time of the first sample on the recorder's clock.


@dataclass(frozen=True)
class SmallRelease:
    """The contents of the release's files by their names from `extracts/` on, and the folder to write them to."""

    files: dict[str, bytes]
    folder: Path

    @property
    def manifest(self) -> Path:
        """The manifest file of the undamaged release."""
        return self.folder / "manifest.json"

    def zip(self, changes: dict[str, bytes] | None = None, top: str = "dextron-abc/data/") -> Path:
        """Writes the release as a zip file and returns its path; `changes` replace or add contents."""
        file = self.folder / "release.zip"
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in {**self.files, **(changes or {})}.items():
                archive.writestr(top + name, content)
        return file

    def unpacked(self) -> Path:
        """Writes the release as a folder and returns its path."""
        top = self.folder / "dextron-abc"
        for name, content in self.files.items():
            file = top / "data" / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        return top


def make_small_release(folder: Path) -> SmallRelease:
    """A release below `folder`.

    Each reach has six samples, 0.1 s and 0.1 m along x apart, and the annotation `reached` 0.3 s after the first.
    """
    rows = [{"q": [1.0, 0.0, 0.0, 0.0], "x": [-0.5 + 0.1 * i, -0.2, -0.1], "t": START + 0.1 * i} for i in range(6)]
    samples = "".join(json.dumps(row) + "\n" for row in rows).encode()
    annotations = json.dumps([["start", START], ["reached", START + 0.3], ["top", START + 0.5]]).encode()
    files = {f"extracts/{name}.json": samples for name in NAMES}
    files |= {f"extracts/meta/{name}_meta.json": annotations for name in NAMES}
    release = SmallRelease(files, folder / "published")
    release.folder.mkdir()
    hashes = {file: hashlib.sha256(content).hexdigest() for file, content in files.items()}
    release.manifest.write_text(json.dumps({"files": hashes}))
    return release
