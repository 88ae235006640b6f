"""Wrong arguments: a framed error becomes one line, and an unknown word is answered with the nearest known one."""

from __future__ import annotations

import re

import pytest

from dextron_bench.cli import main
from dextron_bench.cli.support.usage import one_line

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


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("run --methd exp", "unknown flag --methd; did you mean --method?; see `dextron-bench run --help`"),
        ("run --method reflex --naer 1", "unknown flag --naer; did you mean --near?; see `dextron-bench run --help`"),
        ("run --method stopping --settngs=3", "unknown flag --settngs; did you mean --settings?; see"),
        ("run --method-settings 3", "unknown flag --method-settings; did you mean --method?; see"),
        ("compare reflex --fail-if-wors bc", "unknown flag --fail-if-wors; did you mean --fail-if-worse?; see"),
        ("run --method stopping --setting-s 3", "unknown flag --setting-s; did you mean --settings?; see"),
        ("view --lve", "unknown flag --lve; did you mean --live?; see"),
        ("run --seed x", "--seed: "),
        ("runs list --method x --sort nix", "invalid choice 'nix' for argument '--sort'"),
        ("runs list --method x --tga y", "unknown flag --tga; did you mean --tag?; see"),
        ("data import --from x --quite", "unknown flag --quite; did you mean --quiet?; see"),
        ("run --sed=3", "unknown flag --sed; did you mean --seed?; see `dextron-bench run --help`"),
        ("rnu", "unknown word rnu; did you mean run?; see `dextron-bench --help`"),
        ("leaderboard show --rnus x", "unknown flag --rnus; did you mean --runs?; see `dextron-bench leaderboard show"),
        ("leaderboard show --board x", "unknown flag --board; see `dextron-bench leaderboard show --help`"),
        ("leaderboard shwo", "unknown word shwo; did you mean show?; see `dextron-bench leaderboard --help`"),
        ("run qqqqq", "unknown word qqqqq; see `dextron-bench run --help`"),
    ],
)
def test_an_unknown_word_is_answered_with_the_nearest_of_the_same_command(
    words: str, line: str, capsys: pytest.CaptureFixture[str]
):
    with pytest.raises(SystemExit) as ended:
        main.main(words.split())
    assert ended.value.code == 2
    assert line in capsys.readouterr().err
