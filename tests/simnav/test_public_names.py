"""`import simnav`: quick, complete, and every scenario of the catalogue has its Gymnasium id."""

from __future__ import annotations

import importlib
import subprocess
import sys

import gymnasium
import pytest

import simnav
from simnav.scenario.catalogue import headers


@pytest.mark.parametrize("name", simnav.__all__)
def test_every_public_name_is_there_and_is_the_one_of_its_module(name):
    value = getattr(simnav, name)
    home = importlib.import_module(f"simnav.{simnav._home_of[name]}")
    assert value is getattr(home, name)
    assert name in home.__all__


def test_all_is_what_the_modules_give():
    assert set(simnav.__all__) == set(simnav._home_of)
    assert set(simnav.__all__) <= set(dir(simnav))
    assert simnav.__version__[0].isdigit()


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Kalman'"):
        simnav.Kalman  # noqa: B018


def test_every_scenario_is_registered():
    assert headers()
    for header in headers():
        spec = gymnasium.spec(header.gym_id)
        assert spec.kwargs == {"scenario": header.id}
        assert spec.vector_entry_point is not None
    with pytest.raises(gymnasium.error.NameNotFound, match="OpenSea"):
        gymnasium.make("simnav:simnav/OpenSee-v1")


HEAVY = ("numba", "scipy", "matplotlib", "gtsam", "pyarrow", "pydantic", "pandas")


def test_the_import_is_light():
    code = f"import simnav, sys; print(*[m for m in {HEAVY} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert out == []
