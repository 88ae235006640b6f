"""The help of all commands, under headings, and of the commands of a group. Tyro writes a command's own help."""

from __future__ import annotations

import inspect
import shutil
import textwrap
from collections.abc import Sequence

from dextron_bench.cli.commands import SECTIONS, Command, Commands, Group, find

PROGRAM = "dextron-bench"
WIDEST = 100  # Columns.
NAMES = 17  # Columns of the names.
DESCRIPTION = """Grasping with a prosthetic hand that a person moves: a benchmark."""
END = """`dextron-bench COMMAND --help` shows a command's flags; --version shows the version.

Exit codes: 0 done, 1 a verification or comparison failed, 2 wrong usage or input, 3 the agent raised errors in some
episodes, 70 an unexpected error, 130 interrupted. With --debug, or if DEXTRON_DEBUG is set, an error shows its
traceback."""


def show(names: Sequence[str], group: Group | None) -> None:
    """Prints the help of a group of commands; of all commands if it is None."""
    sections = {"commands": group.members} if group else SECTIONS
    print(f"usage: {' '.join([PROGRAM, *names])} COMMAND [FLAGS]\n")
    print(_filled(group.description if group else DESCRIPTION))
    for heading, members in sections.items():
        print(f"\n{heading}:")
        print(*(_entry(name, command) for name, command in _whole(members)), sep="\n")
    if not group:
        print("", "\n\n".join(map(_filled, END.split("\n\n"))), sep="\n")


def description(names: Sequence[str], command: type[Command]) -> str:
    """The help text of a command; it ends with the commands that begin with its name."""
    place = next((table[names[0]] for table in SECTIONS.values() if names[0] in table), None)
    members = place.members if isinstance(place, Group) and place.command and len(names) == 1 else {}
    lines = [f"`{PROGRAM} {names[0]} {name}`: {_summary(member)}" for name, member in members.items()]
    return "\n\n".join([_text(find(names)[1]), *lines])


def _whole(members: Commands) -> list[tuple[str, type[Command] | Group]]:
    """Names with their commands; the members of a group whose first word is a command too stand below it."""
    entries: list[tuple[str, type[Command] | Group]] = []
    for name, command in members.items():
        entries.append((name, command))
        if isinstance(command, Group) and command.command:
            entries += [(f"  {member}", one) for member, one in command.members.items()]
    return entries


def _entry(name: str, command: type[Command] | Group) -> str:
    """A name with the first paragraph of its help."""
    lines = textwrap.wrap(_summary(command), _width() - NAMES - 2)
    head = f"  {name:{NAMES}}"
    first = [head + lines[0]] if len(name) < NAMES else [head, " " * len(head) + lines[0]]
    return "\n".join([*first, *(" " * (NAMES + 2) + line for line in lines[1:])])


def _summary(command: type[Command] | Group) -> str:
    return " ".join(_text(command).split("\n\n", 1)[0].split())


def _text(command: object) -> str:
    """The help text of a command, or of a group."""
    if isinstance(command, Group):
        return _text(command.command) if command.command else command.description
    return inspect.getdoc(command) or ""


def _filled(text: str) -> str:
    return textwrap.fill(" ".join(text.split()), _width(), break_on_hyphens=False)


def _width() -> int:
    return min(shutil.get_terminal_size().columns, WIDEST)
