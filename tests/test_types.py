"""Types: simnav's own, and those of rows that somebody else declares, in one run of mypy."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from simnav.estimators.stubs import main

ROOT = Path(__file__).parents[1]

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


@pytest.mark.slow
@pytest.mark.usefixtures("clean_registry")
def test_mypy_accepts_what_is_right_and_refuses_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    mine, uses = tmp_path / "my_rows.py", tmp_path / "uses_of_rows.py"
    mine.write_text(MINE, encoding="utf-8")
    uses.write_text(USES, encoding="utf-8")
    assert main([str(mine)]) == 0
    assert capsys.readouterr().out.strip() == str(mine.with_suffix(".pyi"))
    command = [sys.executable, "-m", "mypy", "--package", "simnav", "--module", "uses_of_rows"]
    environment = {"MYPYPATH": f"{tmp_path}:{ROOT}", "PATH": ""}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment)
    assert not done.stderr
    found: dict[int, str] = {}
    for line in done.stdout.splitlines():
        place = re.match(r".*uses_of_rows\.py:(\d+): error: .*\[([a-z-]+)\]$", line)
        assert place or line.startswith("Found ") or ": note: " in line, done.stdout  # simnav itself has no error
        if place:
            found[int(place[1])] = place[2]
    expected = {k: line.partition("  # ")[2] for k, line in enumerate(USES.splitlines(), 1) if "  # " in line}
    assert found == expected, done.stdout
