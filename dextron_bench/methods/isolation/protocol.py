"""The protocol between the benchmark and an agent's process: a line of JSON each way (docs/agents.md).

The first line to the agent is `{"protocol": 1, "seed": 0, "episodes": 256}`, its answer `{"protocol": 1}`, to which it
may add `"name"`. Each line after it is `{"reset": [rows], "states": [[48 numbers], ...]}`, a row an episode, and the
answer `{"actions": [numbers]}`, one a row. Rows in `reset` begin a new episode. When its input ends, the agent ends.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

PROTOCOL = 1
ROOM = 40  # [bytes] that an action may take in an answer.
HEAD = 4096  # [bytes] that the rest of an answer may take.


class BadAnswer(ValueError):
    """A line that is no answer of this protocol."""


def greeting(seed: int, episodes: int) -> bytes:
    """The first line to an agent."""
    return _line({"protocol": PROTOCOL, "seed": seed, "episodes": episodes})


def greeted(line: bytes) -> str:
    """The name in an agent's first answer, empty where it has none; raises BadAnswer."""
    found = _read(line)
    if found.get("protocol") != PROTOCOL:
        raise BadAnswer(f'its first line must be {{"protocol": {PROTOCOL}}}, not {_shown(line)}')
    return str(found.get("name", ""))


def question(reset: list[int], states: np.ndarray) -> bytes:
    """The line that asks for actions in states (N, 48); episodes in rows `reset` are new."""
    return _line({"reset": reset, "states": states.tolist()})


def asked(line: bytes) -> tuple[np.ndarray, np.ndarray]:
    """The rows that begin a new episode and the states (N, 48) of a question; raises BadAnswer."""
    found = _read(line)
    return np.array(found["reset"], int), np.array(found["states"], float)


def answer(actions: np.ndarray) -> bytes:
    """The line that answers with actions (N, 1) or (N,)."""
    return _line({"actions": np.asarray(actions, float).reshape(len(actions)).tolist()})


def actions(line: bytes, count: int) -> np.ndarray:
    """The actions (N, 1) of an answer for so many episodes; raises BadAnswer. They may be NaN or infinite."""
    found = _read(line).get("actions")
    if not isinstance(found, list) or not all(type(each) in (int, float) for each in found):
        raise BadAnswer(f'an answer must be {{"actions": [numbers]}}, not {_shown(line)}')
    if len(found) != count:
        raise BadAnswer(f"it answered with {len(found)} actions for {count} states")
    try:
        return np.array(found, float)[:, None]
    except OverflowError as error:
        raise BadAnswer("it answered with a number that no float holds") from error


def longest(count: int) -> int:
    """The most bytes of an answer for so many episodes."""
    return HEAD + ROOM * count


def _line(message: dict[str, Any]) -> bytes:
    return json.dumps(message, separators=(",", ":")).encode() + b"\n"


def _read(line: bytes) -> dict[str, Any]:
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise BadAnswer(f"it wrote {_shown(line)} where a JSON object on one line was due")
    return found


def _shown(line: bytes) -> str:
    text = line.decode(errors="replace").strip()
    return repr(text if len(text) <= 60 else f"{text[:60]}...")
