"""The guide to GNSS from satellites: its tables make a scenario, and its Python runs."""

from __future__ import annotations

import re
from pathlib import Path

from simnav.scenario import parse
from simnav.simulation.simulator import simulate
from tests.cases.raw_gnss import without_instruments

TEXT = (Path(__file__).parents[2] / "docs" / "how-to" / "use-satellites.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)


def test_the_tables_make_a_scenario():
    tables = [block for block in blocks("toml") if "navigation =" not in block and "file =" not in block]
    assert len(tables) == 4
    scenario = parse(without_instruments() + "\n".join(tables))
    recording = simulate(scenario.model_copy(update={"duration": 20.0}), 1)
    assert len(recording.data.aids["gnss_raw"]) > 200
    assert len(recording.data.aids["fix"]) == 20


def test_the_python_of_the_page(capsys):
    (code,) = blocks("python")
    exec(code, {})
    assert capsys.readouterr().out.startswith("[[41. 88. 78.]]")
