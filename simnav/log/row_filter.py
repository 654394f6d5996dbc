"""Which rows of a table count: a condition on its columns, as text.

A condition compares columns with numbers or text, like ``Q == 1 and sdn < 0.5``, or ``mode == 'A' or mode == 'D'``.
Comparisons (``==``, ``!=``, ``<``, ``<=``, ``>``, ``>=``, also in a row: ``0 < hdop <= 2``) are joined by ``and``,
``or`` and ``not``, with parentheses. A column whose name has other characters than letters, digits and underscores, or
that has a number in place of a name, stands in back quotes. A comparison with a missing value is false.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.log.table import LogError, Table

__all__ = ["RowFilter"]

_TOKEN = re.compile(
    r"\s*(?:(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<text>'[^']*'|\"[^\"]*\")|`(?P<quoted>[^`]+)`"
    r"|(?P<sign>==|!=|<=|>=|<|>|\(|\))|(?P<word>[^\W\d]\w*))"
)
_COMPARISONS: dict[str, Callable[[Any, Any], Any]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_RIGHT = "like \"Q == 1 and sdn < 0.5\"; comparisons are ==, !=, <, <=, >, >=, joined by 'and', 'or', 'not'"
_DEEPEST = 50

Mask = NDArray[np.bool_]
Operand = Callable[[Table], Any]
Condition = Callable[[Table], Mask]


class RowFilter:
    """A condition on the columns of a table.

    Parameters
    ----------
    text : str
        The condition.

    Raises
    ------
    ValueError
        If it is no condition; the message says where, and what would be right.
    """

    def __init__(self, text: str):
        self.text = text
        self._tokens: list[tuple[str, str, int]] = []
        at = 0
        while text[at:].strip():
            match = _TOKEN.match(text, at)
            if match is None:
                raise self._wrong(text[at:].strip()[:20], at)
            kind = str(match.lastgroup)
            self._tokens.append((kind, match.group(kind), match.start(kind)))
            at = match.end()
        self._next = self._depth = 0
        self._condition = self._either()
        if self._next < len(self._tokens):
            raise self._unexpected()

    def rows(self, table: Table) -> Mask:
        """(n,) bool array: the rows that fulfil the condition.

        Raises
        ------
        LogError
            If there is no such column.
        """
        return self._condition(table)

    def _wrong(self, what: str, at: int) -> ValueError:
        return ValueError(f"where = {self.text!r}: {what!r} at character {at + 1} is not understood; write it {_RIGHT}")

    def _unexpected(self) -> ValueError:
        if self._next >= len(self._tokens):
            return ValueError(f"where = {self.text!r} is incomplete; write it {_RIGHT}")
        _, token, at = self._tokens[self._next]
        return self._wrong(token, at)

    def _take(self, *tokens: str) -> str | None:
        """The next token if it is one of these."""
        if self._next < len(self._tokens):
            kind, token, _ = self._tokens[self._next]
            if token in tokens and kind in ("sign", "word"):
                self._next += 1
                return token
        return None

    def _either(self) -> Condition:
        parts = [self._both()]
        while self._take("or"):
            parts.append(self._both())
        return parts[0] if len(parts) == 1 else lambda table: np.any([part(table) for part in parts], axis=0)

    def _both(self) -> Condition:
        parts = [self._single()]
        while self._take("and"):
            parts.append(self._single())
        return parts[0] if len(parts) == 1 else lambda table: np.all([part(table) for part in parts], axis=0)

    def _single(self) -> Condition:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ValueError(f"where = {self.text[:60]!r}...: more than {_DEEPEST} conditions inside each other")
        try:
            if self._take("not"):
                inner = self._single()
                return lambda table: ~inner(table)
            if self._take("("):
                whole = self._either()
                if not self._take(")"):
                    raise self._unexpected()
                return whole
            return self._comparison()
        finally:
            self._depth -= 1

    def _comparison(self) -> Condition:
        operands, signs = [self._operand()], []
        while sign := self._take(*_COMPARISONS):
            signs.append(_COMPARISONS[sign])
            operands.append(self._operand())
        if not signs:
            raise self._unexpected()

        def holds(table: Table) -> Mask:
            values = [operand(table) for operand in operands]
            compared = [_compare(s, a, b, len(table)) for s, a, b in zip(signs, values, values[1:], strict=False)]
            return np.asarray(np.all(compared, axis=0), dtype=bool)

        return holds

    def _operand(self) -> Operand:
        if self._next >= len(self._tokens):
            raise self._unexpected()
        kind, token, _ = self._tokens[self._next]
        if kind == "sign" or (kind == "word" and token in ("and", "or", "not")):
            raise self._unexpected()
        self._next += 1
        if kind == "number":
            number = float(token)
            return lambda table: number
        if kind == "text":
            return lambda table: token[1:-1]
        return lambda table: self._column(table, token)

    def _column(self, table: Table, name: str) -> Any:
        if name in table.columns:
            return table.columns[name]
        which: int | str = int(name) if name.isdecimal() and len(name) < 9 else name
        try:
            return table.columns[table.resolve(which)[1]]
        except LogError as error:
            hint = "" if "did you mean" in str(error) else f"; text stands in quotes, like '{name}'"
            raise LogError(f"{error} (where = {self.text!r}{hint})") from None


def _compare(sign: Callable[[Any, Any], Any], a: Any, b: Any, rows: int) -> Mask:
    """A comparison of columns, numbers and text; text is compared with a number as a number."""
    if isinstance(a, str) or isinstance(b, str) or (_is_text(a) and _is_text(b)):
        left, right = _texts(a, rows), _texts(b, rows)
        pairs = zip(left, right, strict=True)
        return np.array([s is not None and t is not None and bool(sign(s, t)) for s, t in pairs], dtype=np.bool_)
    x, y = _numbers(a), _numbers(b)
    with np.errstate(invalid="ignore"):
        holds: Mask = np.asarray(sign(x, y), dtype=np.bool_) & ~np.isnan(x) & ~np.isnan(y)
    return np.broadcast_to(holds, (rows,))


def _is_text(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == object


def _texts(value: Any, rows: int) -> list[str | None]:
    if isinstance(value, str):
        return [value] * rows
    if not isinstance(value, np.ndarray):
        return [f"{value:g}"] * rows
    if value.dtype == object:
        return [None if cell is None else str(cell).strip() for cell in value]
    return [None if np.isnan(cell) else f"{cell:g}" for cell in value]


def _numbers(value: Any) -> Any:
    if not _is_text(value):
        return np.asarray(value, dtype=np.float64)
    out = np.full(len(value), np.nan)
    for k, cell in enumerate(value):
        try:
            out[k] = float(cell)
        except (TypeError, ValueError):
            continue
    return out
