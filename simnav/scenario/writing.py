"""A scenario as the text of a TOML file, from which `simnav.scenario.parse` makes an equal scenario."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["toml_text"]

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(table: Mapping[str, Any]) -> str:
    """The text of a TOML file.

    Parameters
    ----------
    table : mapping
        Texts, booleans, numbers, lists and tables, such as `simnav.scenario.Scenario.to_toml` returns.

    Raises
    ------
    TypeError
        If a value is of another type.

    Examples
    --------
    >>> print(toml_text({"name": "pond", "start": {"speed_m_s": 2.0}, "fault": [{"kind": "outage"}]}))
    name = "pond"
    <BLANKLINE>
    [start]
    speed_m_s = 2.0
    <BLANKLINE>
    [[fault]]
    kind = "outage"
    <BLANKLINE>
    """
    return "\n".join(_lines(table, ())) + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """The values of a table, then the tables below it. Those below the second level stand on one line."""
    below: list[tuple[str, Any]] = []
    for key, value in table.items():
        deep = isinstance(value, Mapping) or (bool(value) and _are_tables(value))
        if deep and len(path) < 2:
            below.append((key, value))
        else:
            yield f"{_key(key)} = {_value(value)}"
    for key, value in below:
        head = ".".join(map(_key, (*path, key)))
        for one in [value] if isinstance(value, Mapping) else value:
            yield ""
            yield f"[{head}]" if isinstance(value, Mapping) else f"[[{head}]]"
            yield from _lines(one, (*path, key) if isinstance(value, Mapping) else (*path, key, ""))


def _are_tables(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and all(isinstance(one, Mapping) for one in value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }" if value else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    raise TypeError(f"{value!r} of type {type(value).__name__} has no form in TOML")
