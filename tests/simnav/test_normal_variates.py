"""Compiled normal variates against NumPy's generator."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from simnav import normal_variates
from simnav.normal_variates import NormalVariates
from simnav.streams import stream


def test_variates_are_those_of_numpy() -> None:
    """Half a million, of which about a hundred are in the tail beyond the ziggurat."""
    expected = stream(3, "a").standard_normal((170_000, 3))
    found = np.empty_like(expected)
    NormalVariates(stream(3, "a")).fill(found)
    assert (np.abs(expected) > 3.66).sum() > 50
    np.testing.assert_array_equal(found, expected)


def test_a_stream_continues_and_a_copy_continues_by_itself() -> None:
    expected = stream(4, "a").standard_normal((900, 2))
    variates, parts = NormalVariates(stream(4, "a")), [np.empty((n, 2)) for n in (1, 399, 500)]
    for part in parts[:2]:
        variates.fill(part)
    other, again = copy.deepcopy(variates), np.empty((500, 2))
    variates.fill(parts[2])
    other.fill(again)
    np.testing.assert_array_equal(np.concatenate(parts), expected)
    np.testing.assert_array_equal(again, parts[2])


def test_without_a_compiler_numpy_draws_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(normal_variates, "_tables", lambda: None)
    found = np.empty((7, 3))
    NormalVariates(stream(5, "a")).fill(found)
    np.testing.assert_array_equal(found, stream(5, "a").standard_normal((7, 3)))
