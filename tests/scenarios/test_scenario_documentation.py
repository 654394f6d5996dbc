"""docs/reference/scenarios.md stays true: its examples load, its tables hold the keys and the defaults of the code."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from simnav.scenario import parse
from simnav.spec import Spec, spec_types, toml_number, unit_of

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "reference" / "scenarios.md"
TEXT = DOCUMENT.read_text(encoding="utf-8")


def _blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def _tables(marker: str) -> dict[str, list[list[str]]]:
    """The rows of cells of each table that follows a marker, by what the marker says."""
    tables = {}
    for match in re.finditer(rf"<!-- {marker}: (.*?) -->\n((?:\|.*\n)+)", TEXT):
        rows = [[c.strip() for c in line.strip("|\n").split("|")] for line in match[2].splitlines()]
        tables[match[1]] = rows[2:]
    return tables


def _find(dotted: str) -> Any:
    module, _, name = dotted.rpartition(".")
    return getattr(import_module(module), name)


def _code(cell: str) -> list[str]:
    return re.findall(r"`([^`]*)`", cell)


def _default(spec: type[Spec], key: str) -> str:
    """The default of a key as the document prints it."""
    info = spec.toml_keys()[key][1]
    if info.is_required():
        return "required"
    value = info.get_default(call_default_factory=True)
    unit = unit_of(info)

    def number(x: float) -> float:
        return x if unit is None else round(toml_number(x, unit), 9)

    if isinstance(value, Spec):
        return "table"
    if value is None or value == {} or (value == () and spec_types(info.annotation)):
        return "none"
    if isinstance(value, tuple):
        return f"`{[number(v) for v in value]}`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{number(value)}`"


KEYS, KINDS = _tables("keys"), _tables("kinds")


def test_the_worked_example_is_a_scenario():
    scenario = parse(_blocks("toml")[0], source=str(DOCUMENT))
    assert scenario.id == "turn-in-outage-v1"
    assert list(scenario.instruments_sheet()) == ["gnss", "gyrocompass"]
    assert [f.kind for f in scenario.faults] == ["outage", "gross_error"]


def test_the_example_of_a_log_is_one():
    log = tomllib.loads(_blocks("toml")[1])
    head = 'name = "a"\nversion = 1\ntitle = "t"\nduration_s = 60.0\n'
    head += '[instruments.gnss]\nkind = "gnss_position"\nsigma_m = 1.0\n'
    scenario = parse(head + _blocks("toml")[1], source=str(DOCUMENT))
    assert scenario.recorded
    assert set(log["log"]["files"]) == {"fixes", "best"}


def test_the_python_example_runs(capsys):
    exec(_blocks("python")[0], {})
    assert capsys.readouterr().out.startswith("open-sea-v1 simnav/OpenSea-v1 ")


def test_no_table_is_overlooked():
    assert len(KEYS) == 21
    assert len(KINDS) == 5


def _one_spec_tables() -> Iterator[tuple[type[Spec], list[list[str]], int]]:
    for marker, rows in KEYS.items():
        for column, dotted in enumerate(marker.split()):
            yield _find(dotted), rows, column


@pytest.mark.parametrize(
    ("spec", "rows", "column"), list(_one_spec_tables()), ids=lambda v: v.__name__ if isinstance(v, type) else ""
)
def test_table_of_keys(spec, rows, column):
    specs = max(1, len(rows[0]) - 2)  # several classes may share a table
    documented = {_code(row[column])[0]: row[specs] for row in rows}
    assert documented == {key: _default(spec, key) for key in spec.toml_keys()}


@pytest.mark.parametrize("marker", list(KINDS))
def test_table_of_kinds(marker):
    dotted, _, common = marker.partition("; common: ")
    specs = {spec.model_fields["kind"].default: spec for spec in spec_types(_find(dotted))}
    specs.pop("imu", None)  # it has a table of its own
    documented = {_code(row[0])[0]: row[1] for row in KINDS[marker]}
    assert set(documented) == set(specs)
    for kind, cell in documented.items():
        keys = specs[kind].toml_keys()
        assert set(_code(cell)) == set(keys) - {"kind", *common.split()}, kind
        bold = {k for part in re.findall(r"\*\*(.*?)\*\*", cell) for k in _code(part)}
        required = {k for k, (_, info) in keys.items() if info.is_required()} - {"kind", *common.split()}
        assert bold == required, kind
