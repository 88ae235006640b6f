"""Specs of agents: which text names what, and what a text that names nothing is answered."""

from __future__ import annotations

import string
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dextron_bench.methods.specs import AgentSpec, BadSpec, parse

NAMES = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True)
MODULES = st.lists(NAMES, min_size=1, max_size=4).map(".".join)
METHODS = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_+-]{0,12}", fullmatch=True)
FOLDERS = st.lists(st.text(string.ascii_letters + "._- :é", min_size=1, max_size=6), max_size=3)
PATHS = st.builds(lambda folders, name: "/".join([*folders, name]), FOLDERS, NAMES)
SPECS = st.one_of(
    st.builds(AgentSpec, st.just("method"), METHODS),
    st.builds(AgentSpec, st.just("module"), NAMES, MODULES),
    st.builds(lambda name, path: AgentSpec("file", name, f"{path}.py"), NAMES, PATHS),
    st.builds(lambda path, end: AgentSpec("policy", "", path + end), PATHS, st.sampled_from([".pt", ".onnx"])),
    st.builds(lambda words: AgentSpec("command", "", " ".join(words)), st.lists(NAMES, min_size=1, max_size=4)),
)


@pytest.mark.parametrize(
    ("text", "spec"),
    [
        ("reflex", AgentSpec("method", "reflex")),
        ("package.module:MyAgent", AgentSpec("module", "MyAgent", "package.module")),
        ("my_agent/agent.py:MyAgent", AgentSpec("file", "MyAgent", "my_agent/agent.py")),
        (r"C:\agents\agent.py:MyAgent", AgentSpec("file", "MyAgent", r"C:\agents\agent.py")),
        ("policy.pt", AgentSpec("policy", "", "policy.pt")),
        ("./12:30/policy.onnx", AgentSpec("policy", "", "./12:30/policy.onnx")),
        ("exec:./agent.py --mode a:b", AgentSpec("command", "", "./agent.py --mode a:b")),
        ("exec:run policy.pt", AgentSpec("command", "", "run policy.pt")),
        ("executor:Agent", AgentSpec("module", "Agent", "executor")),
        ("policy.pkl", AgentSpec("method", "policy.pkl")),
    ],
)
def test_each_kind_of_spec(text: str, spec: AgentSpec):
    assert parse(text) == spec


@pytest.mark.parametrize(
    ("text", "advice"),
    [
        ("", "write a method's name, module:Class or file.py:Class"),
        (":MyAgent", "write a method's name, module:Class or file.py:Class"),
        ("package.module:", "write a method's name, module:Class or file.py:Class"),
        ("my_agent/agent.py", "name its class too, as in my_agent/agent.py:MyAgent"),
        ("exec:", "write the command after 'exec:'"),
        ("exec:agent 'x", "is not a command (No closing quotation)"),
    ],
)
def test_a_text_that_names_no_agent_says_what_to_write(text: str, advice: str):
    with pytest.raises(BadSpec) as caught:
        parse(text)
    assert advice in str(caught.value)
    assert text in str(caught.value)


@given(SPECS)
def test_the_text_of_a_spec_is_parsed_to_the_same_spec(spec: AgentSpec):
    assume(not str(spec).startswith("exec:") or spec.kind == "command")
    assert parse(str(spec)) == spec


@given(st.text(max_size=30) | st.text("ab.:/ 'expycont", max_size=20))
def test_every_text_is_an_error_or_a_spec_that_returns_it(text: str):
    try:
        spec = parse(text)
    except BadSpec:
        return
    assert str(spec) == text
    assert bool(spec.name) == (spec.kind in ("method", "module", "file"))
    assert bool(spec.location) == (spec.kind != "method")
    assert spec.file == (Path(spec.location) if spec.kind in ("file", "policy") else None)
    assert spec.kind != "command" or spec.command()
