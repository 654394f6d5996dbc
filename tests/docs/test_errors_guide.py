"""The guide to the errors of instruments: its TOML is a scenario, and its process of one's own works."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import simnav
from simnav.plugins import load_plugin
from simnav.scenario import parse
from simnav.sensors.error_processes import ERROR_PROCESSES
from simnav.simulation.simulator import simulate

GUIDE = (Path(simnav.__file__).parents[1] / "docs/how-to/errors-of-instruments.md").read_text(encoding="utf-8")
HEAD = """
name = "guide"
version = 1
title = "The instruments of the guide"
duration_s = 400.0
[start]
latitude_deg = 60.0
longitude_deg = 5.0
speed_m_s = 5.0
"""


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", GUIDE, re.DOTALL)


def test_the_gyrocompass_of_the_guide_is_simulated():
    scenario = parse(HEAD + blocks("toml")[0])
    assert len(scenario.aids["gyrocompass"].processes) == 5
    assert len(simulate(scenario, 1).data.aids["gyrocompass"].time) == 400


def test_the_process_of_the_guide_can_be_used(tmp_path: Path):
    (tmp_path / "laplace.py").write_text(blocks("python")[0])
    load_plugin(tmp_path / "laplace.py")
    try:
        table = '[instruments.depth]\nsigma_m = 0.0\n[[instruments.depth.error]]\nkind = "laplace"\nsigma_m = 0.5\n'
        scenario = parse(HEAD + table)
        assert scenario.instruments_sheet()["depth"].sigma == pytest.approx([0.5])
        assert np.std(simulate(scenario, 1).data.aids["depth"].value) == pytest.approx(0.5, rel=0.15)
    finally:
        ERROR_PROCESSES._classes.pop("laplace")


def test_every_kind_and_factor_is_in_the_documentation():
    from simnav.sensors.error_processes import named_factors

    reference = (Path(simnav.__file__).parents[1] / "docs/reference/scenarios.md").read_text(encoding="utf-8")
    assert all(f"| `{kind}` |" in reference for kind in ERROR_PROCESSES.items())
    first = {name: key for key, (name, _) in reversed(named_factors().items())}
    assert all(f"`{key}`" in GUIDE or f"{key} =" in GUIDE for key in first.values())
