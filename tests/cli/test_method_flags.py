"""The flags of a method: a framed error becomes one line."""

from __future__ import annotations

import re

import pytest

from dextron_bench.cli.method_flags import one_line

BOX = """╭─ Value error ────────╮
│ Error parsing --rate: │
│ not a float: 'x'.     │
│ ───────────────────── │
│ Argument helptext:    │
│     --rate FLOAT      │
│ ───────────────────── │
│ For full helptext, see│
╰──────────────────────╯
"""


ASCII = re.sub("[╭╰╮╯]", " ", BOX).replace("│", " ").replace("─", "-").replace("- Value error --", "Value error\n --")


@pytest.mark.parametrize("box", [BOX, ASCII])
def test_a_box_becomes_one_line(box: str):
    assert one_line(box) == "Error parsing --rate: not a float: 'x'"
