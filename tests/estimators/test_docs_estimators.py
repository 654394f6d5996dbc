"""The examples of docs/reference/estimators.md keep the contract, and the tables tell the truth."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from simnav.estimator import describe, make, names
from simnav.testing.contract_check import check

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "estimators.md"
TEXT = PAGE.read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python\n(.*?)^```", TEXT, flags=re.DOTALL | re.MULTILINE)


@pytest.mark.usefixtures("clean_registry")
@pytest.mark.parametrize("k", range(len(EXAMPLES)))
def test_examples_keep_the_contract(tmp_path: Path, k: int):
    path = tmp_path / f"example_{k}.py"
    path.write_text(EXAMPLES[k])
    report = check(str(path))
    assert report.passed, str(report)


def test_the_first_example_is_short():
    lines = [line for line in EXAMPLES[0].splitlines() if line.strip()]
    body = [line for line in lines if not line.startswith(("import", "from"))]
    assert len(lines) <= 25, len(lines)
    assert len(body) <= 22


@pytest.mark.usefixtures("clean_registry")
def test_the_first_example_is_useful(tmp_path: Path, recording_of, run_over):
    """Half the error of the fixes, and gross errors do not matter."""
    path = tmp_path / "alpha_beta.py"
    path.write_text(EXAMPLES[0])
    recording = recording_of(1, 300.0, turning=0.0, sea=0.0)
    gnss = recording.data.aids["gnss"]
    gnss.value[::20, 0] += 100.0 / 6.37e6
    errors, _ = run_over(make(str(path)), recording)
    lever = np.array([2.0, -1.0, -8.0])  # not corrected for
    yaw = recording.data.truth.attitude[0, 2]
    ned = np.array([np.cos(yaw) * lever[0] - np.sin(yaw) * lever[1], np.sin(yaw) * lever[0] + np.cos(yaw) * lever[1]])
    rmse = np.sqrt(np.mean((errors[50:, :2] - ned) ** 2))
    assert rmse < 0.6 * 1.5


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
