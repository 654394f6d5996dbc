"""The tables of docs/reference/estimators.md are true."""

from __future__ import annotations

import re
from pathlib import Path

from simnav.estimator import describe, names

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "estimators.md"
TEXT = PAGE.read_text(encoding="utf-8")


def test_the_parameter_table_is_true():
    """Every parameter in the table is one, with its default."""
    table = TEXT[TEXT.index("| estimator | parameter |") :].split("\n\n")[0]
    told, current = {}, ""
    for line in table.splitlines()[2:]:
        name, parameters, defaults, _ = (cell.strip() for cell in line.strip("|").split("|"))
        current = name.strip("`") or current
        pairs = zip(parameters.replace("`", "").split(", "), defaults.split(", "), strict=True)
        told[current] = [*told.get(current, []), *pairs]
    assert {"ekf", "ship-ekf", "gnss-only", "dead-reckoning", "iekf", "ekf-23"} <= set(told)
    for name, pairs in told.items():
        real = {p.name: p.default for p in describe(name).parameters}
        assert {p for p, _ in pairs} <= set(real), name
        for parameter, default in pairs:
            assert str(real[parameter]).lower().removesuffix(".0") == default, (name, parameter)


def test_the_rows_that_it_names_exist():
    table = TEXT[TEXT.index("| name | what it is |") :].split("\n\n")[0]
    named = re.findall(r"^\| `([a-z-]+)` \|", table, flags=re.MULTILINE)
    assert len(named) >= 6
    assert set(named) <= set(names())
