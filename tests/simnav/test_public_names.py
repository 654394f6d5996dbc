"""`import simnav`: quick, complete, and every scenario of the catalogue has its Gymnasium id."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import gymnasium
import pytest

import simnav
from simnav.scenario.catalogue import headers


def homes() -> dict[str, str]:
    """Public names and the modules that type checkers and editors take them from."""
    blocks = (node for node in ast.parse(Path(simnav.__file__).read_text()).body if isinstance(node, ast.If))
    (checked,) = (block for block in blocks if ast.unparse(block.test) == "TYPE_CHECKING")
    return {name.name: str(line.module) for line in checked.body for name in line.names}


@pytest.mark.parametrize("name", simnav.__all__)
def test_every_public_name_is_there_and_is_the_one_of_its_module(name):
    home = importlib.import_module(homes()[name])
    assert getattr(simnav, name) is getattr(home, name)
    assert name in home.__all__


def test_type_checkers_see_the_names_that_are_there():
    assert sorted(simnav.__all__) == sorted(homes())
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
