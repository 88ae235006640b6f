"""The protocol between the benchmark and an agent's process: one line of JSON each way (docs/agents.md).

The benchmark first sends `{"protocol": 1, "seed": 0, "episodes": 256}`; the agent answers `{"protocol": 1}` and may add
`"name"`. Each further line is `{"reset": [rows], "states": [[48 numbers], ...]}` with one row per episode, and its
answer `{"actions": [numbers]}` has one number per row. Rows in `reset` begin a new episode. The agent ends when its
input ends.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from dextron_bench.errors import BadInput

PROTOCOL = 1
ACTION_SIZE = 40  # [bytes] that one action may take in an answer.
HEAD_SIZE = 4096  # [bytes] that the rest of an answer may take.


class BadAnswer(BadInput):
    """A line that does not follow the protocol."""


def write_greeting(seed: int, episodes: int) -> bytes:
    """The benchmark's first line."""
    return _to_line({"protocol": PROTOCOL, "seed": seed, "episodes": episodes})


def read_greeting(line: bytes) -> str:
    """The agent's name from its first line, empty if it gives none; raises BadAnswer."""
    message = _from_line(line)
    if message.get("protocol") != PROTOCOL:
        raise BadAnswer(f'its first line must be {{"protocol": {PROTOCOL}}}, not {_quote(line)}')
    return str(message.get("name", ""))


def write_question(reset: list[int], states: np.ndarray) -> bytes:
    """The line that asks for actions in states (N, 48); rows `reset` begin a new episode."""
    return _to_line({"reset": reset, "states": states.tolist()})


def read_question(line: bytes) -> tuple[np.ndarray, np.ndarray]:
    """The rows that begin a new episode, and the states (N, 48), of a question; raises BadAnswer."""
    message = _from_line(line)
    return np.array(message["reset"], int), np.array(message["states"], float)


def write_actions(actions: np.ndarray) -> bytes:
    """The line that answers with actions (N, 1) or (N,)."""
    return _to_line({"actions": np.asarray(actions, float).reshape(len(actions)).tolist()})


def read_actions(line: bytes, count: int) -> np.ndarray:
    """The actions (count, 1) of an answer, which may be NaN or infinite; raises BadAnswer."""
    numbers = _from_line(line).get("actions")
    if not isinstance(numbers, list) or not all(type(number) in (int, float) for number in numbers):
        raise BadAnswer(f'an answer must be {{"actions": [numbers]}}, not {_quote(line)}')
    if len(numbers) != count:
        raise BadAnswer(f"it answered with {len(numbers)} actions for {count} states")
    try:
        return np.array(numbers, float)[:, None]
    except OverflowError as error:
        raise BadAnswer("it answered with a number that no float holds") from error


def max_answer_size(count: int) -> int:
    """The largest size [bytes] of an answer for `count` episodes."""
    return HEAD_SIZE + ACTION_SIZE * count


def _to_line(message: dict[str, Any]) -> bytes:
    return json.dumps(message, separators=(",", ":")).encode() + b"\n"


def _from_line(line: bytes) -> dict[str, Any]:
    try:
        message = json.loads(line)
    except (ValueError, RecursionError):
        message = None
    if not isinstance(message, dict):
        raise BadAnswer(f"it wrote {_quote(line)} instead of a JSON object on one line")
    return message


def _quote(line: bytes) -> str:
    text = line.decode(errors="replace").strip()
    return repr(text if len(text) <= 60 else f"{text[:60]}...")
