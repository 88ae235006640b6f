"""The list of what isolated agents may import: the code and docs/agents.md have the same list."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import dextron_bench
from dextron_bench.methods.isolation.guard import PUBLIC

DOCS = Path(__file__).parents[3] / "docs" / "agents.md"


def test_the_docs_list_the_public_names_that_agents_may_import():
    homes = {name: getattr(getattr(dextron_bench, name), "__module__", "") for name in dextron_bench.__all__}
    (paragraph,) = re.findall(r"- From this package it may import.*?(?=\n\n|\n- )", DOCS.read_text(), flags=re.DOTALL)
    listed = set(re.findall(r"`([\w.]+)`", paragraph))
    modules = {f"dextron_bench.{name}" for name in ("world.model", "world.task", "reaches.rotation", "reaches.reach")}
    assert listed == {name for name, module in homes.items() if module in PUBLIC} | modules
    assert modules <= PUBLIC


def test_public_modules_import_only_public_modules():
    code = f"import {', '.join(sorted(PUBLIC))}, sys; print(*(m for m in sys.modules if m.startswith('dextron_bench')))"
    imported = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert set(imported) - {"dextron_bench.world.registration"} == PUBLIC  # Every import registers.


@pytest.mark.slow
def test_public_names_that_were_used_before_are_hidden_too():
    code = """
import dextron_bench
from dextron_bench.methods.isolation import guard
before = dextron_bench.rollout, dextron_bench.Perceptron
guard.hide_simulator()
print(*sorted({"rollout", "Perceptron"} & vars(dextron_bench).keys()))
"""
    output = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert output.split() == ["Perceptron"]
