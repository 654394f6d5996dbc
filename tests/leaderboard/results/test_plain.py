"""Values as JSON can hold them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simnav.leaderboard.results.plain import as_json


def test_json_has_no_nan_and_knows_arrays():
    value = {"a": np.array([1.0, np.nan]), "b": float("inf"), "c": Path("x"), 3: np.float64(2.5), "d": (True, None)}
    assert as_json(value) == {"a": [1.0, None], "b": None, "c": "x", "3": 2.5, "d": [True, None]}


def test_dataclasses_become_dicts_all_the_way_down():
    @dataclass(frozen=True)
    class Point:
        x: float

    assert as_json({"p": (Point(1.0), Point(float("nan")))}) == {"p": [{"x": 1.0}, {"x": None}]}
