"""An estimator that is a program: the example in C++, and programs that fail."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from simnav.estimator import EstimatorError
from simnav.estimator.program import ProgramEstimator
from simnav.scenario import parse
from simnav.source import record
from simnav.trial import run_trial

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


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no compiler of C++")
def test_the_example_in_c(tmp_path, recording):
    subprocess.run(["g++", "-o", tmp_path / "coasting", EXAMPLES / "coasting.cpp"], check=True)
    trial = run_trial(ProgramEstimator(str(tmp_path / "coasting")), recording)
    assert (trial.status, len(trial)) == ("ok", 20)
    # A fix at the end of each step is the estimate, and the velocity is that between two fixes.
    fixes = recording.data.aids["gnss"].value
    np.testing.assert_allclose(trial.position, fixes[-20:], atol=1e-12)
    assert trial.velocity[5, 0] == pytest.approx(6371e3 * (fixes[5, 0] - fixes[4, 0]), rel=1e-6)
    assert np.isnan(trial.attitude).all()


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
