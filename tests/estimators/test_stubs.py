"""Stub files of rows: they are current, and type checkers, editors and documentation read them."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

from simnav.estimator import find, names
from simnav.estimators.composition import Row
from simnav.estimators.stubs import main, own_modules, stub_of

ROOT = Path(__file__).parents[2]

#: A file as somebody else writes it: an adaptation, a row that uses it, and what else a file holds.
MINE = '''\
"""My filter."""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav import register
from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.composition import Row
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.rows.kalman import Ekf
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.types import Array

LIMIT: float = 16.0


def nis(innovation: Innovation) -> float:  # a remark
    # another
    s = innovation.predicted + innovation.noise
    return float(innovation.residual @ np.linalg.solve(s, innovation.residual))


class Gate(Adaptation):
    """Grüße: a line with letters of several bytes."""

    def __init__(self, limit: float = LIMIT, sort: Literal["all", "fixes"] = "all", units: tuple[str, ...] = ("m",)):
        self.limit = limit

    def adapt(self, innovation: Innovation) -> Array | None:
        return innovation.noise if nis(innovation) < self.limit else None

    @property
    def double(self) -> float: return 2.0 * self.limit


@register("my-gated-ekf")
class Gated(Row, solver=KalmanEstimator, model=InertialModel, adaptation=Gate):
    """EKF that leaves out measurements whose innovation is improbable."""

    slow = True

    def asked(self) -> int:
        """A method."""
        return 3


class More(Ekf, adaptation=Gate):
    """One of simnav's rows with one more piece."""
'''

#: Uses, and what mypy says of each line: the code of its error, or nothing.
USES = """\
from my_rows import Gate, Gated, More, nis
from simnav.estimators.rows.heavy_tails import StudentTRts
from simnav.estimators.rows.kalman import Ekf, PureInertial
from simnav.estimators.rows.windows import SwFgo
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.kalman import KalmanEstimator
Ekf(calibrate=False)
Ekf(iterate_above_deg=None)
Ekf(calibrate="no")  # arg-type
Ekf(calibrat=False)  # call-arg
PureInertial()
PureInertial(calibrate=True)  # call-arg
SwFgo(window=None, spacing=1)
SwFgo(window=2.5)  # arg-type
StudentTRts(adaptation__dof=4.0, smoother__dof=3.0)
StudentTRts(smoothed_dof=3.0)  # call-arg
Gated(limit=9.0, sort="fixes", units=("m", "deg"), calibrate=True).asked().bit_length()
Gated(sort="some")  # arg-type
Gated(limits=9.0)  # call-arg
Gated().asked() + "a"  # operator
More(limit=9.0, calibrate=False)
More(limit="wide")  # arg-type
Gate(limit=3.0).double.hex()
Gate(limit="wide")  # arg-type
class Unwritten(Row, solver=KalmanEstimator, model=piece(InertialModel)): ...
Unwritten(calibrate=False, anything=1)
class Misnamed(Row, solver="kalman", model=InertialModel): ...  # arg-type
"""


def test_the_stubs_of_our_rows_are_current():
    for module in own_modules():
        path = Path(inspect.getfile(module)).with_suffix(".pyi")
        assert path.is_file(), f"python -m simnav.estimators.stubs writes {path.name}"
        assert path.read_text(encoding="utf-8") == stub_of(module), (
            f"{path.name}: run python -m simnav.estimators.stubs"
        )
    assert {find(n).__module__ for n in names() if issubclass(find(n), Row)} == {m.__name__ for m in own_modules()}


def test_a_stub_has_the_signature_of_each_row():
    """Read back without any of our code."""
    seen = set()
    for module in own_modules():
        for node in ast.parse(Path(inspect.getfile(module)).with_suffix(".pyi").read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                cls = getattr(module, node.name)
                (made,) = (f for f in node.body if isinstance(f, ast.FunctionDef))
                stub = {a.arg: ast.literal_eval(d) for a, d in zip(made.args.kwonlyargs, made.args.kw_defaults)}
                assert stub == {p.name: p.default for p in inspect.signature(cls).parameters.values()}
                seen.add(cls.name)
    assert seen >= {n for n in names() if issubclass(find(n), Row)}


@pytest.mark.slow
@pytest.mark.usefixtures("clean_registry")
def test_mypy_accepts_what_is_right_and_refuses_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    mine, uses = tmp_path / "my_rows.py", tmp_path / "uses.py"
    mine.write_text(MINE, encoding="utf-8")
    uses.write_text(USES, encoding="utf-8")
    assert main([str(mine)]) == 0
    assert capsys.readouterr().out.strip() == str(mine.with_suffix(".pyi"))
    command = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), str(uses)]
    environment = {"MYPYPATH": f"{tmp_path}:{ROOT}", "PATH": ""}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment)
    assert not done.stderr
    found: dict[int, str] = {}
    for line in done.stdout.splitlines():
        place = re.match(r".*uses\.py:(\d+): error: .*\[([a-z-]+)\]$", line)
        assert place or line.startswith("Found ") or ": note: " in line, done.stdout
        if place:
            found[int(place[1])] = place[2]
    expected = {k: line.partition("  # ")[2] for k, line in enumerate(USES.splitlines(), 1) if "  # " in line}
    assert found == expected, done.stdout


@pytest.mark.usefixtures("clean_registry")
def test_a_file_that_needs_no_stub_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "plain.py"
    path.write_text("x = 1\n")
    assert main([str(path)]) == 1
    assert main([str(tmp_path / "absent.py")]) == 1
    assert main(["simnav.absent"]) == 1
    said = capsys.readouterr().err.splitlines()
    assert "plain.py: it declares no row, so that it needs no stub" in said[0]
    assert "absent.py: it cannot be imported" in said[1]
    assert "simnav.absent: it cannot be imported: No module named 'simnav.absent'" in said[2]
    assert not list(tmp_path.glob("*.pyi"))


def test_an_editor_shows_the_parameters():
    jedi = pytest.importorskip("jedi")
    source = "from simnav.estimators.rows.kalman import Ekf\nEkf("
    project = jedi.Project(ROOT)
    (signature,) = jedi.Script(source, project=project).get_signatures(2, 4)
    assert [p.name for p in signature.params] == ["calibrate", "iterate_above_deg"]
    assert signature.params[0].to_string() == "calibrate: bool=True"


def test_documentation_shows_the_parameters():
    griffe = pytest.importorskip("griffe")
    module = griffe.load("simnav.estimators.rows.kalman", search_paths=[str(ROOT)])
    parameters = {p.name: str(p.annotation) for p in module["Ekf"].parameters}
    assert parameters == {"self": "None", "calibrate": "bool", "iterate_above_deg": "float | None"}
    assert "15-state error-state EKF" in module["Ekf"].docstring.value
