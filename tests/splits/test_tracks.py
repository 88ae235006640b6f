"""Names of tracks, and splits under a track."""

from __future__ import annotations

import pytest

from dextron_bench.reaches.timing import CONTROL_STEP
from dextron_bench.splits import tracks
from dextron_bench.splits.loading import UnknownSplit, load_split
from dextron_bench.splits.strata import shipped_strata


def test_a_delay_lasts_as_long_as_its_name_says():
    for name, track in tracks.TRACKS.items():
        kind, _, number = name.partition("-")
        assert track.name == name
        assert track.delay * CONTROL_STEP * 1000 == pytest.approx(float(number) if kind == "delay" else 0.0)
        assert (track.noise is not None) == (kind == "sensing")
        assert (track.bottle.quantity if track.bottle else "") == (number if kind == "bottle" else "")


def test_a_split_under_a_track_has_its_cases_and_a_version_of_its_own():
    plain, late, later = (load_split("synthetic", name) for name in ("test", "test+delay-40", "test+delay-100"))
    assert late.cases == plain.cases
    assert (late.name, late.track.delay, later.track.delay) == ("test+delay-40", 2, 5)
    assert len({plain.digest, late.digest, later.digest}) == 3
    assert shipped_strata("synthetic", late.name, late.digest) is not None
    assert shipped_strata("synthetic", late.name, plain.digest) is None


def test_unknown_tracks_and_splits_are_named():
    with pytest.raises(tracks.UnknownTrack, match="no track 'delay-1'; choose from delay-40"):
        load_split("synthetic", "test+delay-1")
    with pytest.raises(tracks.UnknownTrack):
        tracks.name_of("test", "nix")
    with pytest.raises(UnknownSplit, match="no split 'nix' "):
        load_split("synthetic", "nix+delay-40")
