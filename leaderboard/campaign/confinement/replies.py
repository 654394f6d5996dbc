"""What an estimator process says beside its estimates: facts in JSON, and a trajectory."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from simnav.trial.wire import ANSWER, InvalidOutputError
from simnav.types import NavigationStates

__all__ = ["facts_in", "trajectory_in"]


def facts_in(reply: bytes) -> dict[str, Any]:
    """The JSON object in an answer."""
    try:
        facts = json.loads(reply[ANSWER.size :] or b"{}")
    except (ValueError, RecursionError):
        facts = None
    if not isinstance(facts, dict):
        raise InvalidOutputError("the answer is not in the form of an estimate")
    return facts


def trajectory_in(body: bytes) -> NavigationStates:
    """Four arrays: their shapes in JSON, then their numbers."""
    try:
        begin = 8 + int.from_bytes(body[:8])
        shapes = [tuple(map(int, shape)) for shape in json.loads(body[8:begin])]
        arrays = []
        for shape in shapes:
            if any(s < 0 for s in shape):
                raise ValueError
            count = int(np.prod(shape, dtype=object)) if shape else 1
            arrays.append(np.frombuffer(body, np.float64, count, begin).reshape(shape))
            begin += 8 * count
        time_, position, velocity, attitude = arrays
    except (ValueError, TypeError, RecursionError, OverflowError):
        raise InvalidOutputError("the trajectory is not in the form of arrays") from None
    return NavigationStates(time_, position, velocity, attitude)
