"""The text of a scenario makes an equal scenario."""

from __future__ import annotations

import tomllib

import pytest

from simnav.scenario import load
from simnav.scenario.catalogue import headers
from simnav.scenario.writing import toml_text


@pytest.mark.parametrize("name", sorted({h.name for h in headers()}))
def test_every_scenario_of_the_catalogue(name: str):
    table = load(name).to_toml()
    assert tomllib.loads(toml_text(table)) == _plain(table)


def _plain(value):
    """Tuples as lists, as TOML has them."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    return [_plain(v) for v in value] if isinstance(value, (list, tuple)) else value


def test_odd_values():
    table = {
        "a key": 'a "text"\nof two lines \x7f ü', "empty": [], "no": {}, "far": float("inf"), "yes": True, "n": -3,
        "deep": {"er": {"and": {"deeper": [1, 2.5, {"x": [{"y": "z"}]}]}, "list": [{"a": 1}, {"a": {"b": 2}}]}},
    }  # fmt: skip
    assert tomllib.loads(toml_text(table)) == table
    with pytest.raises(TypeError, match="None of type NoneType has no form in TOML"):
        toml_text({"nothing": None})
