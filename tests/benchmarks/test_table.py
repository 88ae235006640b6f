"""Lines of the table of benchmarks, with ratios computed by hand."""

from tests.benchmarks.table import line, number

ROW = {"what": "Steps", "unit": "steps/s", "rate": 950.0, "against": "bare", "against_rate": 1000.0, "aim": 0.95}


def test_a_line_with_and_without_a_reference():
    assert line(ROW) == "| Steps | 950 steps/s | bare | 1,000 steps/s | 0.95 (aim 0.95) |\n"
    assert line(ROW | {"against": "", "against_rate": None}) == "| Steps | 950 steps/s |  |  |  |\n"


def test_numbers_have_three_significant_digits():
    assert [number(value) for value in (12345.6, 99.94, 0.012345)] == ["12,346", "99.9", "0.0123"]
