"""The guide to instruments stays true: its files are those of the tests, its tables hold what the code knows."""

from __future__ import annotations

import re
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import get_args

import pytest

from simnav.blocks import Process, StateBlock
from simnav.kinds import EQUATIONS, Kind, Role
from simnav.sensors.faults import Effect

GUIDES = Path(__file__).parents[3] / "docs" / "how-to"
TEXT = (GUIDES / "add-an-instrument.md").read_text(encoding="utf-8")
STATES = (GUIDES / "states-of-an-instrument.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["beacon.py", "echo.py", "lagoon.toml"])
def test_the_files_on_the_page_are_those_that_are_tested(plugins, name):
    block = re.search(rf"^`{name}`:\n\n```\w+\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
    assert block is not None
    assert block[1] == (plugins / name).read_text()


@pytest.mark.parametrize("name", ["magnetometer.py", "fjord.toml"])
def test_the_files_on_the_page_of_states_are_those_that_are_tested(plugins, name):
    block = re.search(rf"^`{name}`:\n\n```\w+\n(.*?)^```$", STATES, re.MULTILINE | re.DOTALL)
    assert block is not None
    assert block[1] == (plugins / name).read_text()


@pytest.mark.parametrize("name", ["steady_turn.py", "drifting_buoy.py"])
def test_the_files_on_the_page_of_models_are_those_that_are_tested(plugins, name):
    text = (GUIDES / "a-model-of-your-own.md").read_text(encoding="utf-8")
    assert f"```python\n{(plugins / name).read_text()}```" in text


def test_the_page_of_states_has_every_field_and_process():
    rows = dict(re.findall(r'^\| `"?(\w+)"?` \| (.*?) \|$', STATES, re.MULTILINE))
    assert {field.name for field in fields(StateBlock)} <= set(rows)
    assert set(get_args(Process)) <= set(rows)


def test_the_entry_points_are_toml():
    block = re.search(r'^```\n(\[project\.entry-points\."simnav.*?)^```$', TEXT, re.MULTILINE | re.DOTALL)
    assert set(tomllib.loads(block[1])["project"]["entry-points"]) == {"simnav.instruments", "simnav.faults"}


def test_the_tables_hold_what_there_is():
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*?) \|$", TEXT, re.MULTILINE))
    assert {name: rows[name] for name in EQUATIONS} == dict(EQUATIONS)
    of_kind = {name for name in Kind.__dataclass_fields__ if not name.startswith("_")}
    assert set(rows) == of_kind | set(EQUATIONS)
    assert re.findall(r'`"(\w+)"`', rows["role"]) == list(get_args(Role))
    told = next(line for line in TEXT.splitlines() if line.startswith("`effect` describes"))
    assert set(re.findall(r'`"(\w+)"`', told)) == set(get_args(Effect)) - {"imu"}
