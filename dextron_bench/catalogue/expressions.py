"""Filters tables by expressions such as `cause == 'too late' and return < 5`, without running any code.

An expression is parsed as Python, and only these parts are allowed: names of columns, texts, numbers, True and False,
lists of them after `in`, comparisons, `and`, `or`, `not` and parentheses. `AND`, `OR`, `NOT`, `IN` and `=`, as in SQL,
mean the same. A comparison with a missing value is false.
"""

from __future__ import annotations

import ast
import io
import operator
import tokenize
import warnings
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

import numpy as np
import pandas as pd

LONGEST = 1000  # Characters of an expression.
KEYWORD = "return_"  # Stands for the column `return`, which is no name in Python.
SPELLINGS = {"return": KEYWORD, "AND": "and", "OR": "or", "NOT": "not", "IN": "in", "=": "=="}
ORDERS = {
    **{ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le},
    **{ast.Gt: operator.gt, ast.GtE: operator.ge},
}
ALLOWED = "names of columns, texts, numbers, comparisons, in, and, or, not"


class BadExpression(ValueError):
    """An expression that is no filter of the table; the message says why."""


def matches(table: pd.DataFrame, text: str) -> np.ndarray:
    """True for each row (N,) of a table for which an expression is true, or for all if it is empty.

    Raises BadExpression.
    """
    if not text.strip():
        return np.ones(len(table), bool)
    try:
        return np.broadcast_to(_truth(_parse(text), table), len(table))
    except RecursionError:
        raise BadExpression("the expression is nested too deeply") from None


def filtered(table: pd.DataFrame, text: str, columns: Iterable[str]) -> pd.DataFrame:
    """The rows of a table for which an expression over its `columns` is true; raises BadExpression."""
    return table[matches(table[[name for name in columns if name in table]], text)] if text.strip() else table


def _parse(text: str) -> ast.expr:
    if len(text) > LONGEST:
        raise BadExpression(f"the expression has {len(text)} characters; {LONGEST} are allowed")
    try:
        tokens = tokenize.generate_tokens(io.StringIO(text.strip()).readline)
        words = [(token.type, SPELLINGS.get(token.string, token.string)) for token in tokens]
        with warnings.catch_warnings(action="ignore"):  # Python warns of odd texts.
            return ast.parse(tokenize.untokenize(words).strip(), mode="eval").body
    except (SyntaxError, ValueError, tokenize.TokenError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else "it is incomplete"
        raise BadExpression(f"cannot read {text.strip()!r}: {reason}; write as in return < 5") from None


def _truth(node: ast.expr, table: pd.DataFrame) -> np.ndarray:
    """True or False for each row, or for all rows at once."""
    if isinstance(node, ast.BoolOp):
        combine = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
        return combine.reduce([np.broadcast_to(_truth(part, table), len(table)) for part in node.values])
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return np.logical_not(_truth(node.operand, table))
    if isinstance(node, ast.Compare):
        return _comparisons(node, table)
    value = _value(node, table)
    if _kind(value) != "true or false":
        raise BadExpression(f"{_text(node)} is no condition; compare it, as in {_text(node)} == {_example(value)!r}")
    return value


def _comparisons(node: ast.Compare, table: pd.DataFrame) -> np.ndarray:
    """A comparison, or a chain such as 0 < return < 5."""
    parts = [node.left, *node.comparators]
    results = [_comparison(*sides, table) for sides in zip(parts, node.ops, parts[1:], strict=False)]
    return np.logical_and.reduce([np.broadcast_to(result, len(table)) for result in results])


def _comparison(left: ast.expr, sign: ast.cmpop, right: ast.expr, table: pd.DataFrame) -> np.ndarray:
    if isinstance(sign, (ast.In, ast.NotIn)):
        is_in = _membership(left, right, table)
        return is_in if isinstance(sign, ast.In) else np.logical_not(is_in)
    if type(sign) not in ORDERS:
        raise BadExpression(f"`is` compares nothing here; write ==; allowed are {ALLOWED}")
    values = _value(left, table), _value(right, table)
    _check_kinds((left, values[0]), (right, values[1]))
    return np.logical_and(ORDERS[type(sign)](*values), ~np.logical_or(*map(_missing, values)))


def _membership(left: ast.expr, right: ast.expr, table: pd.DataFrame) -> np.ndarray:
    """A column in a list of values, or a text in a column of texts."""
    value = _value(left, table)
    if isinstance(right, (ast.Tuple, ast.List)):
        choices = [(part, _value(part, table)) for part in right.elts]
        for choice in choices:
            _check_kinds((left, value), choice)
        return np.logical_or.reduce([np.zeros(len(table), bool), *(np.equal(value, choice) for _, choice in choices)])
    column = _value(right, table)
    if isinstance(value, str) and isinstance(column, np.ndarray) and _kind(column) == "text":
        return np.array([value in text for text in column], bool)
    raise BadExpression("after `in` write a list, as in seed in (0, 1), or a column of texts, as in 'late' in cause")


def _value(node: ast.expr, table: pd.DataFrame) -> Any:
    """The values of a column, or one value."""
    if isinstance(node, ast.Name):
        return _column(table, "return" if node.id == KEYWORD else node.id)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _value(node.operand, table)
        if _kind(value) == "a number":
            return -value
    if isinstance(node, ast.Constant) and isinstance(node.value, (str, bool)):
        return node.value
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        try:
            return float(node.value)
        except OverflowError:
            raise BadExpression("a number is too large") from None
    raise BadExpression(f"{_text(node)} is not allowed; allowed are {ALLOWED}")


def _column(table: pd.DataFrame, name: str) -> np.ndarray:
    if name not in table:
        near = get_close_matches(name, map(str, table), 1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise BadExpression(f"there is no column {name!r}; {hint}columns are {', '.join(map(str, table))}")
    column = table[name]
    if column.dtype == bool:
        return column.to_numpy()
    return column.to_numpy(float) if column.dtype.kind in "iuf" else column.to_numpy(object)


def _kind(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return {"b": "true or false", "f": "a number"}.get(value.dtype.kind, "text")
    return "true or false" if isinstance(value, bool) else "a number" if isinstance(value, float) else "text"


def _check_kinds(first: tuple[ast.expr, Any], second: tuple[ast.expr, Any]) -> None:
    (one, value), (other, another) = first, second
    if _kind(value) != _kind(another):
        raise BadExpression(f"{_text(one)} is {_kind(value)}, and {_text(other)} is {_kind(another)}")


def _missing(value: Any) -> Any:
    return np.isnan(value) if _kind(value) == "a number" else False


def _example(value: Any) -> object:
    values: Iterable[Any] = value if isinstance(value, np.ndarray) else [value]
    return next((one for one in values if one == one), 0)


def _text(node: ast.expr) -> str:
    """A part of an expression as the user wrote it, shortened."""
    text = ast.unparse(node).replace(KEYWORD, "return")
    return text if len(text) <= 40 else f"{text[:40]}..."
