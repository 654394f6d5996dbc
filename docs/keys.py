"""The tables of TOML keys in the documentation, made from the code: ``python docs/keys.py`` writes them.

A table follows a mark: ``<!-- keys: CLASS [CLASS] -->`` or ``<!-- keys: profile -->`` (one row for each key), or
``<!-- kinds: UNION; common: KEYS -->`` (one row for each kind). Keys, kinds, defaults, and what is required, come from
the code. The last column may be edited in the page, where it can be more detailed; for a new key it is the field's
description, or what the docstring of its class says.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
import typing
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo

import simnav.scenario.reading  # noqa: F401 (it registers the error process of recordings)
from simnav.field_meanings import meanings
from simnav.sensors.imu import ImuSpec
from simnav.spec import Spec, spec_types, toml_number, unit_of

__all__ = ["PAGES", "current"]

PAGES = [Path(__file__).parent / "reference" / name for name in ("scenarios.md", "files.md")]
_MARK = re.compile(r"<!-- (keys|kinds): ([^;\n]+?)(?:; common: ([^\n]*?))? -->\n(\|.*\n\|[-|]+\|\n)((?:\|.*\n)*)")


def current(text: str) -> str:
    """The text of a page with its tables as they should be."""
    return _MARK.sub(_table, text)


def _table(match: re.Match[str]) -> str:
    sort, names, common, head, body = match.groups()
    begin = match[0][: match[0].index("|")] + head
    if names == "profile":
        from simnav.leaderboard.profiles import KEYS

        return begin + "".join(f"| `{key}` | {meaning} |\n" for key, meaning in KEYS.items())
    found = [_named(name) for name in names.split()]
    told = {row[0].strip("`"): row[-1] for row in map(_cells, body.splitlines())}
    if sort == "kinds":
        specs = [spec for spec in spec_types(found[0]) if spec is not ImuSpec]  # which has tables of its own
        rows = [_kind(spec, set((common or "").split()), told) for spec in specs]
        order = list(told)
        rows.sort(key=lambda row: order.index(k) if (k := row[0].strip("`")) in order else len(order))
    else:
        rows = _keys(found, told)
    return begin + "".join(f"| {' | '.join(row)} |\n".replace("|  |", "| |") for row in rows)


def _named(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def _keys(specs: list[type[Spec]], told: dict[str, str]) -> list[list[str]]:
    """A row for each key; of several classes each has a column, and they have the same fields."""
    keys = [list(spec.toml_keys().items()) for spec in specs]
    said = meanings(specs[0])
    rows = []
    for together in zip(*keys, strict=True):
        name, info = together[0][1]
        meaning = told.get(together[0][0])
        if meaning is None:
            meaning = _prefix(info, _plain(said[name]))
        rows.append([*(f"`{key}`" for key, _ in together), _default(info), meaning])
    return rows


def _kind(spec: type[Spec], common: set[str], told: dict[str, str]) -> list[str]:
    kind = str(spec.model_fields["kind"].default)
    keys = [
        f"**`{key}`**" if info.is_required() else f"`{key}`"
        for key, (name, info) in spec.toml_keys().items()
        if name != "kind" and key not in common
    ]
    summary = (inspect.getdoc(spec) or "").partition("\n\n")[0]
    return [f"`{kind}`", " ".join(keys), told.get(kind) or _plain(summary)]


def _default(info: FieldInfo) -> str:
    if info.is_required():
        return "required"
    value = info.get_default(call_default_factory=True)
    if value is None or (spec_types(info.annotation) and not value):
        return "none"
    if isinstance(value, Spec):
        return "table"
    if isinstance(value, dict):
        return "none"
    unit = unit_of(info)
    return f"`{_number(value, unit)}`"


def _number(value: Any, unit: str | None) -> str:
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(_number(v, unit) for v in value)}]"
    if isinstance(value, str):
        return f'"{value}"'
    return str(value if unit is None else toml_number(value, unit))


def _prefix(info: FieldInfo, meaning: str) -> str:
    """What is no value but a table says so."""
    if not spec_types(info.annotation):
        return meaning
    text = str(typing.get_origin(info.annotation) or info.annotation)
    sort = "array of tables" if "tuple" in text else "tables by name" if "dict" in text else "table"
    return f"{sort}: {meaning}" if meaning and not meaning.startswith("table") else meaning or sort


def _plain(text: str) -> str:
    """A meaning as a cell: without a full stop, with the first letter small."""
    text = re.sub(r"\s+", " ", text).replace("``", "`")
    text = re.sub(r"`(?:simnav\.[\w.]+\.)?(ChannelSpec|LOG_UNITS)`", r"`\1`", text).replace("|", "\\|").rstrip(".")
    return text[:1].lower() + text[1:] if text[1:2].islower() and not text.startswith("Gauss") else text


def main() -> None:
    """Write the tables."""
    for page in PAGES:
        before = page.read_text(encoding="utf-8")
        if current(before) != before:
            page.write_text(current(before), encoding="utf-8")
            sys.stdout.write(f"{page}\n")


if __name__ == "__main__":
    main()
