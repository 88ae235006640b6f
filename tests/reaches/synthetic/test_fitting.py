"""The groups of reaches from which the synthetic model is fitted."""

from __future__ import annotations

from dextron_bench.reaches.synthetic.fitting import Groups
from dextron_bench.reaches.synthetic.generator import open_synthetic


def test_reaches_without_sessions_in_their_names_are_grouped_by_subject():
    source = open_synthetic()
    names = source.names[:144]  # Nine subjects, 16 start regions.
    groups = Groups.from_reaches([source.reach(name) for name in names])
    subjects = sorted({source.stratum(name).subject for name in names})
    assert len(groups.subjects) == len(subjects)
    assert [subjects[k] for k in groups.subject] == [source.stratum(name).subject for name in names]
