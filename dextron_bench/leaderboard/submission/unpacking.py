"""Bundles as folders of runs, so that what looks at runs can look at a submission."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from dextron_bench.leaderboard.submission import bundle, entry, episode_tables
from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.storage import hashing
from dextron_bench.storage.run_folder import seed_folders

FOLDER = Path(entry.FOLDER, ".bundles")  # In the folder of runs; no submission can be called so.


def opened(file: Path, runs: Path) -> Path:
    """The folder below `runs` with the runs of a bundle, called by its SHA-256; unpacked where it is not there yet.

    Its names, hashes and tables were checked; whether its episodes are what its actions give is for `verification`.
    Raises BadBundle, MissingData, OSError.
    """
    if not file.is_file():
        raise bundle.BadBundle(f"there is no file {file}")
    place = runs / FOLDER / hashing.sha256(file)[:16]
    if place.is_dir():
        return place
    place.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".unpacking-", dir=place.parent) as folder:
        part = Path(folder) / "bundle"
        manifest = bundle.unpack(file, part)
        wanted = [load_split(manifest["reaches"], name) for name in ranking_splits(manifest["reaches"])]
        for run in seed_folders(part):
            for fault in episode_tables.faults(episode_tables.read(run.episodes, wanted), wanted):
                raise bundle.BadBundle(f"{file}: {run.path.name}: {fault}")
        part.replace(place)
    return place
