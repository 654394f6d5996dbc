"""What the fields of a specification mean: from their descriptions, and from the docstrings of its classes."""

from __future__ import annotations

import inspect
import re

from simnav.spec import Spec

__all__ = ["meanings"]

_CONSTANT = "fixed_"
_ENTRY = re.compile(r"^(\w[^\n:]*)(?: : [^\n]*)?\n((?:[ \t]+[^\n]*\n?|\n(?=[ \t]))+)", re.MULTILINE)

#: A unit of Python in brackets; keys of TOML name their own.
_UNIT = re.compile(r" \[(?!log|instr|\[)[^\]\s]{1,8}(?:, [^\],\s]{1,8})*\](?!`)")


def meanings(spec: type[Spec]) -> dict[str, str]:
    """The meaning of each field of a specification; empty where none is written down.

    The description of the field comes first, then the section ``Attributes`` of the docstring of its class, then those
    of the base classes. A field of one component, like ``sigma_range``, has the meaning of ``sigma``. Units of Python
    are left out.

    >>> from simnav.sensors.dvl import Dvl
    >>> meanings(Dvl)["bias"]
    'Turn-on bias, one sigma: it is drawn for each run, and constant in it.'
    """
    said: dict[str, str] = {}
    for cls in reversed(spec.__mro__):
        text = inspect.cleandoc(cls.__doc__ or "").partition("\nAttributes\n----------\n")[2]
        for names, meaning in _ENTRY.findall(text + "\n"):
            said |= dict.fromkeys((name.strip() for name in names.split(",")), re.sub(r"\s+", " ", meaning).strip())
    return {name: _UNIT.sub("", info.description or _of(name, said)) for name, info in spec.model_fields.items()}


def _of(name: str, said: dict[str, str]) -> str:
    if name in said:
        return said[name]
    if name.startswith(_CONSTANT):
        return "A constant error that is added, the same in every run; estimators do not receive it."
    for base in sorted(said, key=len, reverse=True):
        if name.startswith(f"{base}_"):
            return f"{said[base].rstrip('.')} (of the component {name.removeprefix(base + '_')})."
    return ""
