"""Characters that drive a terminal, change the direction of text or begin a formula are escaped."""

from __future__ import annotations

import pytest

from dextron_bench.storage.printable import LONGEST, first_hidden, printable, printable_line, spreadsheet_cell


@pytest.mark.parametrize(
    ("text", "escaped"),
    [
        ("\x1b[2Jgone", "\\x1b[2Jgone"),
        ("a\u202egnp.exe", "a\\u202egnp.exe"),
        ("a\u2066b", "a\\u2066b"),
        ("name\n", "name\\n"),
        ("zero\u200bwidth", "zero\\u200bwidth"),
        ("\ud800", "\\ud800"),
        ("\U000e0041", "\\U000e0041"),
    ],
)
def test_characters_without_a_visible_sign_are_escaped(text: str, escaped: str):
    assert printable(text) == escaped
    assert first_hidden(text) in text
    assert first_hidden(text) != ""


def test_a_line_is_cut():
    assert printable_line("\x1b" + "x" * (LONGEST + 6)) == "\\x1b" + "x" * (LONGEST - 1) + "... and 7 more characters"
    assert printable_line("x" * LONGEST) == "x" * LONGEST


@pytest.mark.parametrize("text", ["Müller, 王, 2 GPUs · 50 %", "\u0645\u06cc\u200c\u0631\u0648\u0645"])
def test_names_in_any_script_stay(text: str):
    assert printable(text) == text
    assert first_hidden(text) == ""


@pytest.mark.parametrize("text", ['=HYPERLINK("http://x")', "+1", "-1", "@SUM(A1)", "\t=1"])
def test_a_cell_is_never_a_formula(text: str):
    assert spreadsheet_cell(text).startswith("'")


def test_other_cells_stay():
    assert spreadsheet_cell("Intel(R) Xeon(R), 2 cores") == "Intel(R) Xeon(R), 2 cores"
