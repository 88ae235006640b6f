"""Names that look like another row's name are recognised; other names are not."""

from __future__ import annotations

import pytest

from dextron_bench.submissions.names import appearance, imitated

METHODS = ("bc", "exp", "nothing", "omega", "random", "reflex", "rl", "rlil", "sim", "sor")


@pytest.mark.parametrize(
    ("name", "other"),
    [
        *[("rlil_0.1", "rlil"), ("exp.", "exp"), ("OMEGA2", "omega"), ("rlil-0.1", "rlil"), ("Exp+", "exp")],
        *[("r1il", "rlil"), ("rIil-0.1", "rlil"), ("0mega", "omega"), ("ornega", "omega"), ("s0r", "sor")],
        *[("rl-il-0.1", "rl"), ("ex.p", "exp"), ("bc2", "bc")],
    ],
)
def test_a_name_that_imitates_a_method_is_recognised(name: str, other: str):
    assert imitated(name, METHODS) == other


@pytest.mark.parametrize("name", ["my-agent", "expert", "near", "simple-agent", "rlx-1", "alpha", "omegaverse", "best"])
def test_other_names_are_free(name: str):
    assert imitated(name, METHODS) == ""


def test_rows_that_look_alike_have_one_appearance():
    assert appearance("My-Agent.1") == appearance("my_agentl")
    assert appearance("my-agent") != appearance("my-agent-2")
