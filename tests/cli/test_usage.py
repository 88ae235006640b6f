"""Wrong arguments: one line says what is wrong; an unknown word gets the nearest, an old one the new."""

from __future__ import annotations

import pytest

from dextron_bench.cli import commands, main


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
        ("run --seed x", "--seed: 'x' is not a whole number; see `dextron-bench run --help`"),
        ("run --method rlil --dur=x", "--dur: 'x' is not a number; see"),
        ("run --runs", "--runs needs a value; see"),
        ("compare a", "B is missing; see `dextron-bench compare --help`"),
        ("submit", "AGENT and --name are missing; see"),
        ("check reflex --near x", "--near: 'x' is not a number; see"),
        ("check policy.onnx --near 1", "unknown flag --near; see"),
        ("", "the name of a command is missing; see `dextron-bench --help`"),
        ("compare plan a", "B is missing; see `dextron-bench compare plan --help`"),
        ("runs list --method x --sort nix", "--sort: 'nix' is not one of name, date, val, return, success; see"),
        ("runs list --method x --tga y", "unknown flag --tga; did you mean --tag?; see"),
        ("data import --from x --quite", "unknown flag --quite; did you mean --quiet?; see"),
        ("run --sed=3", "unknown flag --sed; did you mean --seed?; see `dextron-bench run --help`"),
        ("rnu", "unknown word rnu; did you mean run?; see `dextron-bench --help`"),
        ("leaderboard show --rnus x", "unknown flag --rnus; did you mean --runs?; see `dextron-bench leaderboard show"),
        ("runs show x --board x", "unknown flag --board; see `dextron-bench runs show --help`"),
        ("leaderboard shwo", "unknown word shwo; did you mean show?; see `dextron-bench leaderboard --help`"),
        ("run qqqqq", "unknown word qqqqq; see `dextron-bench run --help`"),
    ],
)
def test_an_unknown_word_is_answered_with_the_nearest_of_the_same_command(
    words: str, line: str, capsys: pytest.CaptureFixture[str]
):
    with pytest.raises(SystemExit) as ended:
        main.main(words.split())
    printed = capsys.readouterr()
    assert (ended.value.code, printed.out, printed.err.count("\n")) == (2, "", 1)
    assert line in printed.err


@pytest.mark.parametrize("old", commands.MOVED)
def test_an_old_name_of_a_command_is_answered_with_the_new(old: str, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as ended:
        main.main([*old.split(), "--reaches", "real"])
    assert ended.value.code == 2
    assert f"`{old}` is now {commands.MOVED[old]}; see `dextron-bench" in capsys.readouterr().err


@pytest.mark.parametrize(("command", "flag"), commands.MOVED_FLAGS)
def test_an_old_name_of_a_flag_is_answered_with_the_new(command: str, flag: str, capsys: pytest.CaptureFixture[str]):
    names = command.split()
    agent = ["reflex"] if command in ("check", "submit") else []
    with pytest.raises(SystemExit) as ended:
        main.main([*names, *agent, flag, "x"])
    assert ended.value.code == 2
    assert f"{flag} is now {commands.MOVED_FLAGS[command, flag]}; see `dextron-bench {command} --help`" in (
        capsys.readouterr().err
    )


def test_help_has_few_first_words_under_headings(capsys: pytest.CaptureFixture[str]):
    """A group counts as one word."""
    assert len(commands.COMMANDS) <= 18
    with pytest.raises(SystemExit) as ended:
        main.main(["--help"])
    lines = capsys.readouterr().out.splitlines()
    assert ended.value.code == 0
    assert [line for line in lines if line.endswith(":") and not line.startswith(" ")] == [
        f"{heading}:" for heading in commands.SECTIONS
    ]
    assert all(len(line) <= 80 for line in lines)
