"""Values as JSON can hold them."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

__all__ = ["as_json", "table_of"]


def as_json(value: Any) -> Any:
    """A value as JSON can hold it: arrays become lists, dataclasses dicts, NaN and infinities null."""
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(k): as_json(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [as_json(v) for v in value]
    if hasattr(value, "tolist"):  # NumPy, without importing it
        return as_json(value.tolist())
    if hasattr(value, "to_dict"):
        return as_json(value.to_dict())
    if hasattr(value, "model_dump"):
        return as_json(value.model_dump())
    if dataclasses.is_dataclass(value):
        return {f.name: as_json(getattr(value, f.name)) for f in dataclasses.fields(value)}
    return str(value)


def table_of(text: Any) -> Any:
    """Parameters or draws from their JSON; None where it is none, or no table of plain values by name."""
    try:
        found = json.loads(text)
    except (ValueError, TypeError, RecursionError):
        return None
    return found if isinstance(found, dict) and all(map(_is_plain, found.values())) else None


def _is_plain(value: object) -> bool:
    if isinstance(value, list):
        return len(value) <= 1000 and all(map(_is_plain, value)) and json.dumps(value).count("[") < 1000
    return value is None or isinstance(value, (bool, int, float, str, dict))
