"""`import simnav`: quick, complete, and every scenario of the catalogue has its Gymnasium id."""

from __future__ import annotations

import ast
import importlib
import importlib.machinery
import importlib.util
import subprocess
import sys
from pathlib import Path

import gymnasium
import pytest

import simnav
from simnav import gymnasium_ids
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


HEAVY = ("numpy", "gymnasium", "numba", "scipy", "matplotlib", "gtsam", "pyarrow", "pydantic", "pandas")


def test_the_import_is_light_and_the_ids_are_there_when_gymnasium_is():
    code = f"""
import simnav, sys
assert not [m for m in {HEAVY} if m in sys.modules]
import gymnasium
assert "simnav/OpenSea-v1" in gymnasium.registry
assert type(gymnasium.__spec__.loader) is type(gymnasium.__loader__) is type(simnav.__loader__)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_failed_import_of_gymnasium_is_tried_again(monkeypatch):
    class Failing:
        def create_module(self, spec):
            return None

        def exec_module(self, module):
            raise ImportError("a broken library")

    waiting = gymnasium_ids._Waiting()
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
    spec = importlib.machinery.ModuleSpec("gymnasium", Failing())
    with pytest.raises(ImportError, match="broken"):
        gymnasium_ids._Registering(spec.loader, waiting).exec_module(importlib.util.module_from_spec(spec))
    assert sys.meta_path[0] is waiting
    gymnasium_ids.register_with_gymnasium()  # it is imported: nothing waits, and nothing is registered twice
    assert len([f for f in sys.meta_path if isinstance(f, gymnasium_ids._Waiting)]) == 1
    assert waiting.find_spec("simnav.scoring", None) is None
    assert waiting.find_spec("gymnasium", None).origin == gymnasium.__file__
    assert waiting not in sys.meta_path


def test_the_packages_of_public_names_are_attributes():
    assert simnav.scenario is importlib.import_module("simnav.scenario")
