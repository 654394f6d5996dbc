"""An estimator that is a program: the example in C++, and programs that fail."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from simnav.estimator import Estimator, EstimatorError
from simnav.estimator.files import class_in_file
from simnav.estimator.program import ProgramEstimator
from simnav.scenario import parse
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Estimate

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "programs"
SCENARIO = """
name = "program"
version = 1
title = "for programs"
duration_s = 20.0

[start]
latitude_deg = 54.0
longitude_deg = 8.0
speed_m_s = 5.0

[instruments.gnss]
kind = "gnss_position"
sigma_m = 1.0
"""
#: Repeats the last fix, with lines of JSON.
JSON = """
import json, sys
for line in sys.stdin:
    packet = json.loads(line)
    if packet["type"] == "start":
        fix = packet["position"]
        print("ready", flush=True)
        continue
    for m in packet["measurements"]:
        fix = m["value"]
    print(json.dumps({"time": packet["time"], "position": fix, "sigma": [2.0] * 3 + [0.0] * 6,
                      "diagnostics": {"fixes": len(packet["measurements"])}}), flush=True)
"""


WAIT = "for _ in __import__('sys').stdin: pass"


@pytest.fixture(scope="module")
def recording():
    return record(parse(SCENARIO), 1)


def program(tmp_path, text, **more) -> ProgramEstimator:
    """An estimator that runs a program of Python."""
    path = tmp_path / "it.py"
    path.write_text(text)
    return ProgramEstimator(f"{sys.executable} {path}", **more)


def test_lines_of_json(tmp_path, recording):
    trial = run_trial(program(tmp_path, JSON, lines="json"), recording)
    assert (trial.status, len(trial)) == ("ok", 20)
    assert trial.position[-1] == pytest.approx(recording.data.aids["gnss"].value[-1], abs=1e-15)
    assert trial.diagnostics["fixes"].sum() == len(recording.data.aids["gnss"])
    assert trial.covariance[0, 0, 0] == 4.0


class Coasting(Estimator):
    """The filter of the examples, in Python."""

    def reset(self, start, instruments):
        self.state, self.time = np.concatenate([start.position, start.velocity]), start.time
        self.fixed, self.fixed_at, self.sigma = None, -1.0, 10.0

    def update(self, measurements):
        for m in measurements:
            if self.fixed is not None:
                north, east, _ = (m.value - self.fixed) / (m.time - self.fixed_at)
                self.state[3:5] = 6371e3 * north, 6371e3 * math.cos(m.value[0]) * east
            self.state[:3] = self.fixed = m.value
            self.fixed_at = self.time = m.time
            self.sigma = 3.0
        dt, self.time = measurements.time - self.time, measurements.time
        self.state[0] += self.state[3] * dt / 6371e3
        self.state[1] += self.state[4] * dt / (6371e3 * math.cos(self.state[0]))
        self.sigma = math.hypot(self.sigma, 0.5 * dt)
        variances = [self.sigma**2] * 3 + [1.0] * 3 + [0.0] * 3
        return Estimate(self.time, position=self.state[:3].copy(), velocity=self.state[3:].copy(),
                        covariance=np.diag(variances), estimated=np.arange(9) < 6)  # fmt: skip


@pytest.mark.parametrize(
    ("tool", "run"),
    [
        pytest.param(tool, run, marks=pytest.mark.skipif(shutil.which(tool) is None, reason=f"there is no {tool}"))
        for tool, run in (("g++", "coasting"), ("octave-cli", "octave-cli coasting.m"))
    ],
)
def test_the_examples_compute_what_the_same_filter_does_in_python(clean_registry, tmp_path, tool, run):
    """A fix comes every second step only; the other estimates are coasted."""
    recording = record(parse(SCENARIO + "rate_hz = 0.5\n"), 1)
    for name in ("coasting.py", "coasting.cpp", "coasting.m"):
        shutil.copy(EXAMPLES / name, tmp_path)
    if tool == "g++":
        subprocess.run(["g++", "-o", tmp_path / run, EXAMPLES / "coasting.cpp"], check=True)
    estimator = class_in_file(tmp_path / "coasting.py", None)(run)
    trial, wanted = run_trial(estimator, recording), run_trial(Coasting(), recording)
    assert (trial.status, trial.reason, len(trial)) == ("ok", "", 20)
    np.testing.assert_allclose(trial.position, wanted.position, rtol=1e-15)
    np.testing.assert_allclose(trial.velocity[:, :2], wanted.velocity[:, :2], rtol=1e-12)
    np.testing.assert_allclose(trial.covariance, wanted.covariance, rtol=1e-4)  # it writes six digits
    assert np.isnan(trial.attitude).all()
    assert np.ptp(trial.covariance[:, 0, 0]) > 0.2


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("import sys; sys.exit('no licence')", r"ended before it wrote its 'ready' \(exit code 1\): no licence"),
        ("print('hello', flush=True)", "answered 'hello' to the start, where 'ready' is wanted"),
        (f"print('ready\\nestimate,1', flush=True)\n{WAIT}", "answered 'estimate,1'; wanted"),
        (f"print('ready\\nestimate,1' + ',x' * 9, flush=True)\n{WAIT}", "a cell is not a number"),
        (WAIT, r"did not write its 'ready' within 0.5 s \(it is still running\)"),
        ("print('x' * 3000000, flush=True)", "more than 1048576 bytes in one line"),
    ],
)  # fmt: skip
def test_a_program_that_fails_is_named(tmp_path, recording, text, reason):
    trial = run_trial(program(tmp_path, text, patience=30.0 if "print" in text else 0.5), recording)
    assert trial.status == "error"
    assert re.search(reason, trial.reason), trial.reason


def test_what_cannot_be_a_program():
    with pytest.raises(EstimatorError, match="names no program"):
        ProgramEstimator()
    with pytest.raises(EstimatorError, match="lines = 'xml' should be 'csv' or 'json'"):
        ProgramEstimator("true", lines="xml")


def test_a_program_that_is_not_there(recording):
    trial = run_trial(ProgramEstimator("./no_such_program"), recording)
    assert "the program './no_such_program' cannot be started: No such file" in trial.reason
