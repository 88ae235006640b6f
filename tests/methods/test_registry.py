"""Methods by name, module and file; and the messages if there is no such method."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import fields
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import numpy as np
import pytest

from baselines.exp import Exp
from baselines.floors import Nothing, Random
from baselines.rlil import Rlil
from dextron_bench.methods import loading, registry
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.registry import UnknownMethod
from dextron_bench.methods.settings import _short, settings_class
from dextron_bench.storage import hashing

AGENT = """
from pathlib import Path
with Path(__file__).with_suffix(".log").open("a") as log:
    log.write("executed\\n")

class Mine:
    name = "mine"
    def agent(self, seed): ...
"""


@pytest.fixture
def file(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a method's file with a given text and returns its path."""

    def write(text: str) -> Path:
        (tmp_path / "mine.py").write_text(text)
        return tmp_path / "mine.py"

    return write


def test_an_installed_method_is_found_by_name():
    assert {"exp", "nothing", "random"} <= set(registry.installed_methods())
    assert registry.find_method("exp") is Exp
    assert registry.describe("exp") == 'Replays the expert that solved each setting (paper, fig. 4a, "EXP").'


@pytest.mark.parametrize("name", registry.installed_methods())
def test_every_installed_method_can_be_created_and_has_plain_settings(name: str):
    method = registry.create(name)
    assert method.name == name
    assert all(isinstance(value, (str, int, float, bool, tuple)) for value in registry.settings_of(method).values())
    assert registry.describe(name).endswith(".")


def test_a_method_is_found_by_its_module():
    assert registry.find_method("baselines.floors:Nothing") is Nothing


def test_a_method_is_found_by_its_file_which_is_executed_once(file: Callable[[str], Path]):
    place = file(AGENT)
    first, second = registry.find_method(f"{place}:Mine"), registry.find_method(f"{place}:Mine")
    assert first is second
    assert first.name == "mine"
    assert place.with_suffix(".log").read_text() == "executed\n"


def test_the_hash_of_a_file_changes_with_its_content(file: Callable[[str], Path]):
    spec = f"{file(AGENT)}:Mine"
    before = loading.class_origin(registry.find_method(spec))
    assert before["class"] == "mine.py:Mine"
    file(AGENT + "# A comment.\n")
    assert loading.class_origin(registry.find_method(spec))["sha256"] != before["sha256"]
    assert (
        loading.class_origin(registry.find_method("exp"))
        == loading.class_origin(registry.find_method("baselines.exp:Exp"))
        == {"class": "baselines.exp:Exp", "sha256": None}
    )


def test_an_unknown_name_lists_the_valid_ones():
    with pytest.raises(
        UnknownMethod, match=r"^no method 'xep'; choose from .*exp, .*nothing, .*random.*, or give module"
    ):
        registry.find_method("xep")


@pytest.mark.parametrize(
    ("spec", "complaint"),
    [
        ("nosuch.module:Agent", "needs the Python module nosuch, which is not installed"),
        ("baselines.exp:Nosuch", "baselines.exp has no class 'Nosuch'; it has Exp"),
        ("baselines.exp:dataclass", "is not a method"),
        ("dextron_bench.experts.policies:ExpertAgent", "needs to be a class with `name` and `agent"),
        ("nosuch.py:Agent", "there is no file nosuch.py"),
        (":Agent", "names no agent: write a method's name"),
        ("mine.py", "name its class too, as in mine.py:MyAgent"),
        ("policy.pt", "is a policy, not a method; choose from"),
        ("exec:./agent", "is a command, not a method; choose from"),
    ],
)
def test_a_text_that_names_no_method_raises(spec: str, complaint: str):
    with pytest.raises(UnknownMethod) as caught:
        registry.find_method(spec)
    assert complaint in str(caught.value)
    assert spec in str(caught.value)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1 / 0\n", "cannot be imported: ZeroDivisionError: division by zero"),
        ("def broken(:\n", "cannot be imported: SyntaxError: invalid syntax"),
        ("import nosuchpackage\n", "needs the Python module nosuchpackage, which is not installed"),
        ("raise SystemExit(0)\n", "cannot be imported: SystemExit: 0"),
        ("class Other: ...\n", "has no class 'Mine'"),
        ("class Yours:\n    name = 'yours'\n", "has no class 'Mine'; it has Yours"),
        ("class Mine: ...\n", "is not a method"),
        ("class Mine:\n    name = '../up'\n    def agent(self, seed): ...\n", "has the name '../up'"),
        ("class Mine:\n    name = 3\n    def agent(self, seed): ...\n", "has the name 3"),
    ],
)
def test_a_file_that_cannot_be_imported_raises(file: Callable[[str], Path], text: str, complaint: str):
    spec = f"{file(text)}:Mine"
    for _ in range(2):  # A failed import leaves no module behind.
        with pytest.raises(UnknownMethod) as caught:
            registry.find_method(spec)
        assert complaint in str(caught.value)


def test_a_method_that_cannot_be_created_raises(file: Callable[[str], Path]):
    place = file("class Mine:\n    name = 'mine'\n    def __init__(self, size): ...\n    def agent(self, seed): ...\n")
    with pytest.raises(AgentError, match=r"^making method .* raised TypeError: .*'size'"):
        registry.create(f"{place}:Mine")


SETTINGS = """
from dataclasses import dataclass, field
from typing import ClassVar

@dataclass(frozen=True)
class Mine:
    name: ClassVar[str] = "mine"
    near: float = 0.08
    mode: str = "fast"
    sizes: tuple[int, ...] = (1, 2)
    table: dict = field(default_factory=dict)
    hidden: str = field(default="", metadata={"in_label": False})

    def agent(self, seed): ...
"""


@pytest.mark.parametrize(
    ("settings", "label"),
    [
        ({}, "mine"),
        ({"near": 0.08, "table": {}, "hidden": "x"}, "mine"),
        ({"near": 0.06}, "mine-near0.06"),
        ({"mode": "slow", "near": 2.0}, "mine-near2-modeslow"),
        ({"mode": "../up"}, "mine-mode" + hashing.digest(b"'../up'")[:8]),
        ({"sizes": (3, 4)}, "mine-sizes" + hashing.digest(b"(3, 4)")[:8]),
    ],
)
def test_settings_that_differ_from_the_defaults_are_in_the_label(
    file: Callable[[str], Path], settings: dict, label: str
):
    assert registry.label(registry.create(f"{file(SETTINGS)}:Mine", settings)) == label


PLAIN = """
class Mine:
    name = "mine"
    def __init__(self, near: float = 0.08, mode="fast", size: "int | None" = None, model=None, seed=0, rows=[],
                 hot: bool = False, sizes: tuple[int, ...] = (1,)):
        self.distance = near * 2

    def agent(self, seed): ...
"""


def test_parameters_of_a_class_that_is_no_dataclass_are_settings(file: Callable[[str], Path]):
    spec = f"{file(PLAIN)}:Mine"
    flags = settings_class(registry.find_method(spec), taken={"seed"})
    assert flags is not None
    assert [(field.name, field.type) for field in fields(flags)] == [
        ("near", float), ("mode", str), ("size", int | None), ("hot", bool), ("sizes", tuple[int, ...])
    ]  # fmt: skip
    default, near = registry.create(spec, {"near": 0.08, "mode": "fast"}), registry.create(spec, {"near": 0.06})
    assert [registry.label(method) for method in (default, near)] == ["mine", "mine-near0.06"]
    assert [registry.settings_of(method) for method in (default, near)] == [{}, {"near": 0.06}]
    assert registry.defaults_of(near) == {"near": 0.08, "mode": "fast", "size": None, "hot": False, "sizes": (1,)}
    settings = {"near": 0.06, "mode": "fast", "hot": True, "sizes": (3, 4)}
    assert registry.as_flags(spec, settings) == f"--method {spec} --near 0.06 --hot --sizes 3 4"


def test_an_object_that_cannot_be_noted_has_no_settings(file: Callable[[str], Path]):
    text = PLAIN.replace("class Mine:", "class Mine:\n    __slots__ = ()").replace("self.distance", "distance")
    spec = f"{file(text)}:Mine"
    assert registry.label(registry.create(spec)) == "mine"
    with pytest.raises(registry.BadSettings, match="can have settings only as a dataclass"):
        registry.create(spec, {"near": 0.06})


def test_the_description_of_a_broken_installed_method_says_why(monkeypatch: pytest.MonkeyPatch):
    broken = EntryPoints([EntryPoint("broken", "nosuch.module:Agent", loading.GROUP)])
    monkeypatch.setattr(loading, "entry_points", lambda **params: broken.select(**params))
    assert registry.installed_methods() == ("broken",)
    assert registry.describe("broken").startswith("method 'broken' needs the Python module nosuch")


def test_settings_are_the_fields_of_the_dataclass():
    assert registry.settings_of(Random()) == {}


def test_equal_seeds_act_equally_and_other_seeds_do_not():
    states = np.zeros((4, 48))
    first, again, other = (Random().agent(seed).act(states) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_a_module_is_found_in_the_working_folder_but_replaces_none_that_is_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", list(sys.path))
    (tmp_path / "my_agents").mkdir()
    (tmp_path / "my_agents" / "near.py").write_text("class Near:\n    name = 'near'\n    def agent(self, seed): ...\n")
    for name in ("scipy", "colorsys"):
        (tmp_path / f"{name}.py").write_text("raise ImportError('planted')\n")
    assert registry.find_method("my_agents.near:Near").name == "near"
    assert sys.path[-1] == str(tmp_path)
    with pytest.raises(UnknownMethod, match="colorsys has no class 'Agent'"):
        registry.find_method("colorsys:Agent")


def test_settings_that_differ_in_the_last_digit_have_labels_that_differ():
    """Runs of equal labels would share a folder; values that six digits say exactly keep their labels."""
    values = [0.1, 0.9999999, 0.99999995, 1.0, 1e-7, 1e6, 1234567.0, 0.1 + 0.2]
    labels = [_short(value) for value in values]
    assert len(set(labels)) == len(values)
    assert labels[:3] == ["0.1", "0.9999999", "0.99999995"]
    assert [_short(value) for value in (1.0, 2000.0, 1e6)] == ["1", "2000", "1e+06"]
    assert [Rlil(dur=dur).label for dur in (0.1, 1.0, 0.9999999)] == ["rlil-0.1", "rlil-1", "rlil-0.9999999"]


def test_settings_that_a_learner_does_not_know_are_refused_when_it_is_made():
    with pytest.raises(AgentError, match="KeyError: 'qumck'"):
        registry.create("baselines.rlil:Rlil", {"preset": "qumck"})
