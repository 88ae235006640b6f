"""Unpacks a bundle into a folder of runs, so that `dextron-bench view` can show its episodes."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.storage import hashing
from dextron_bench.storage.run_folder import RunFolder, seed_folders
from dextron_bench.submissions import bundle, entry, episode_tables

FOLDER = Path(entry.FOLDER, ".bundles")  # In the folder of runs; not a valid name of a submission.


def unpack_for_viewing(file: Path, runs: Path) -> Path:
    """The folder below `runs` with the runs of a bundle; unpacks the bundle if the folder does not exist yet.

    The bundle's SHA-256 names the folder. Checks names, hashes and tables; only `verification` replays the actions.
    Raises BadBundle, MissingData, OSError.
    """
    if not file.is_file():
        raise bundle.BadBundle(f"{file} is not a file")
    place = runs / FOLDER / hashing.sha256(file)[:16]
    if place.is_dir():
        return place
    place.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".unpacking-", dir=place.parent) as folder:
        part = Path(folder) / "bundle"
        manifest = bundle.unpack(file, part)
        for table in (RunFolder.of_seed(part, seed).episodes for seed in manifest.seeds):
            if not table.exists():
                raise bundle.BadBundle(
                    f"{file} lacks {table.relative_to(part)}; make it again with `dextron-bench submit`"
                )
        splits = [load_split(manifest.reaches, name) for name in ranking_splits(manifest.reaches)]
        for run in seed_folders(part):
            for fault in episode_tables.faults(episode_tables.read(run.episodes, splits), splits):
                raise bundle.BadBundle(f"{file}: {run.path.name}: {fault}")
        try:
            part.replace(place)
        except OSError:
            if not place.is_dir():  # Else another process has unpacked it meanwhile.
                raise
    return place
