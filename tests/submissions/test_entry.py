"""The entry of a submission: settings, and the rules for names and seeds."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench.submissions import entry
from dextron_bench.submissions.entry import BadSubmission, Entry


def test_settings_of_an_installed_method_are_complete():
    """With these settings the method can be made again."""
    settings = entry.whole_settings("omega", {"near": 0.1}, "synthetic")
    assert settings["near"] == 0.1
    assert len(settings["sha256"]) == 64
    assert entry.whole_settings("omega", settings, "synthetic") == settings
    assert entry.whole_settings("mine.py:Mine", {"near": 0.1}, "synthetic") == {"near": 0.1}


@pytest.mark.parametrize(
    ("name", "seeds", "message"),
    [
        ("rlil-mine", (0,), "'rlil-mine' looks like the name of the method 'rlil'"),
        ("a/b", (0,), "'a/b' is not a valid name"),
        ("a" * 65, (0,), "is not a valid name: use up to 64 letters"),
        ("OMEGA2", (0,), "looks like the name of the method 'omega'"),
        ("mine\n", (0,), "is not a valid name"),
        ("mine", tuple(range(11)), "at most 10 seeds, not 11"),
        ("mine", (1,), "seeds must be 0, 1, 2 and so on"),
        ("mine", (0, 2), "seeds must be 0, 1, 2 and so on"),
    ],
)
def test_a_bad_name_or_chosen_seeds_are_refused(name: str, seeds: tuple[int, ...], message: str):
    with pytest.raises(BadSubmission, match=message):
        Entry(name, "mine.py:Mine", "synthetic", seeds)


def test_the_manifest_names_files_without_their_folders(tmp_path: Path):
    file = tmp_path / "mine.py"
    file.write_text("")
    submission = Entry("mine", f"{file}:Mine", "synthetic", (1, 0), {"near": 0.1})
    manifest = submission.manifest()
    assert manifest["agent"] == {"kind": "code", "spec": "mine.py:Mine", "settings": {"near": 0.1}, "weights": ""}
    assert (manifest["name"], manifest["reaches"], manifest["seeds"]) == ("mine", "synthetic", [1, 0])
    assert submission.files() == {"mine.py": file}
    assert submission.folder(tmp_path) == tmp_path / "submissions" / "mine" / "synthetic"
