"""A third party's test module: the right checks fail by name, and the benchmark has its group."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from simnav.testing import parametrize_with_checks, parametrize_with_rows
from simnav.testing.contract_check import CHECKS
from simnav.testing.estimator_forms import factories

MODULE = '''
import numpy as np
from simnav import Estimate, Estimator
from simnav.testing import parametrize_with_checks, parametrize_with_rows

pytest_plugins = ["simnav.testing.fixtures"]


class Good(Estimator):
    needs = ("gnss_position",)

    def __init__(self, gain=1.0):
        self.gain = gain

    def reset(self, start, instruments):
        self.position = start.position

    def update(self, measurements):
        fix = measurements.latest("gnss_position")
        if fix is not None:
            self.position = self.position + self.gain * (fix.value - self.position)
        return Estimate(measurements.time, self.position.copy())


class Forgetful(Good):
    """Carries something over a reset, and depends on the clock of the process."""

    count = 0

    def update(self, measurements):
        self.count += 1
        self.position = self.position + [0.0, 0.0, 1e-3 * self.count]
        return super().update(measurements)


class WrongShape(Good):
    def update(self, measurements):
        return Estimate(measurements.time, self.position[:2])


@parametrize_with_checks([Good, (Good, {"gain": 0.5}), Forgetful, WrongShape])
def test_contract(estimator, check):
    check(estimator)


@parametrize_with_checks(Forgetful, expected_failures={"reset": "known"})
def test_known(estimator, check):
    check(estimator)


@parametrize_with_checks("gnss-onyl")
def test_unknown(estimator, check):
    check(estimator)


@parametrize_with_rows((Good, {"gain": 0.5}), beside=["gnss-only"], group="an epoch of mine")
def test_cost(benchmark_epochs, make_estimator):
    assert benchmark_epochs(make_estimator, epochs=9) is not None


def test_recordings(recording_of, contract_recording):
    first = recording_of("open-sea", seed=1, duration=10.0)
    assert len(first.data.truth) == 10
    first.data.truth.position[:] = 0.0
    again = recording_of("open-sea", seed=1, duration=10.0)
    assert again.data.truth.position.all()
    other = recording_of("open-sea", seed=2, duration=10.0)
    assert not np.array_equal(again.data.aids["gnss"].value, other.data.aids["gnss"].value)
    assert "imu" not in contract_recording.data.aids
    assert contract_recording.data.imu is not None
'''


def run_pytest(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run pytest as a third party does: not as a worker of this run, in which pytest-benchmark switches itself off."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-rA", "--color=no", *words],
        cwd=folder, env=environment, capture_output=True, text=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def outcome(tmp_path_factory) -> tuple[dict[str, str], str]:
    """What pytest says of each test of the module, and all that it prints."""
    folder = tmp_path_factory.mktemp("third_party")
    (folder / "test_mine.py").write_text(MODULE)
    done = run_pytest(folder, "--benchmark-disable")
    said = {}
    for line in done.stdout.splitlines():
        word, _, rest = line.partition(" ")
        if word in ("PASSED", "FAILED", "XFAIL") and "::" in rest:
            said[rest.partition("::")[2].partition(" - ")[0]] = word
    return said, done.stdout


NAMES = [c.name.replace(" ", "-") for c in CHECKS]


def test_a_good_estimator_passes_all_checks(outcome):
    said, text = outcome
    for label in ("Good", "Good(gain=0.5)"):
        assert [said.get(f"test_contract[{label}-{name}]") for name in NAMES] == ["PASSED"] * len(NAMES), text


def test_a_bad_estimator_fails_the_right_check_by_name(outcome):
    said, text = outcome
    failed = [name for name in NAMES if said[f"test_contract[Forgetful-{name}]"] == "FAILED"]
    assert failed == ["reset"], text
    assert "Forgetful fails the check 'reset': a run before reset() shows: position differs" in text
    sentence = next(c.sentence for c in CHECKS if c.name == "reset")
    assert f"What is demanded: {sentence}" in text


def test_checks_that_would_repeat_a_bad_output_are_skipped(outcome):
    said, text = outcome
    wrong = {name: said.get(f"test_contract[WrongShape-{name}]") for name in NAMES}
    assert wrong == {"output": "FAILED"} | {name: None for name in NAMES if name != "output"}, text
    assert f"[{len(NAMES) - 1}]" in text
    assert "the check 'output' fails, and this check would only repeat it" in text


def test_expected_failures_are_marked(outcome):
    said, _ = outcome
    assert [said[f"test_known[Forgetful-{name}]"] for name in NAMES] == [
        "XFAIL" if name == "reset" else "PASSED" for name in NAMES
    ]


def test_an_unknown_name_fails_with_what_would_be_right(outcome):
    said, text = outcome
    assert {said[f"test_unknown[gnss-onyl-{name}]"] for name in NAMES} == {"FAILED"}
    assert "unknown estimator 'gnss-onyl'; did you mean 'gnss-only'?" in text


def test_recordings_are_fixtures(outcome):
    said, text = outcome
    assert said["test_recordings"] == "PASSED", text
    assert {said["test_cost[Good(gain=0.5)]"], said["test_cost[gnss-only]"]} == {"PASSED"}, text


def test_the_benchmark_has_a_group_of_all_rows(tmp_path: Path):
    (tmp_path / "test_mine.py").write_text(MODULE)
    done = run_pytest(tmp_path, "-k", "test_cost", "--benchmark-json=cost.json")
    assert done.returncode == 0, done.stdout
    rows = json.loads((tmp_path / "cost.json").read_text())["benchmarks"]
    assert {row["group"] for row in rows} == {"an epoch of mine"}
    assert [row["params"] is not None and row["stats"]["rounds"] for row in rows] == [6, 6]
    assert [row["name"] for row in rows] == ["test_cost[Good(gain=0.5)]", "test_cost[gnss-only]"]


def test_a_run_that_does_not_ask_for_the_fixtures_imports_nothing_of_simnav(tmp_path: Path):
    (tmp_path / "test_other.py").write_text(
        "import sys\n\ndef test_other():\n    assert not [m for m in sys.modules if m.partition('.')[0] == 'simnav']\n"
    )
    done = run_pytest(tmp_path)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda: parametrize_with_checks(3), TypeError, "3 is no estimator"),
        (lambda: parametrize_with_checks(["ekf", int]), TypeError, "<class 'int'> is no estimator"),
        (lambda: parametrize_with_checks([]), TypeError, "no estimator was given"),
        (lambda: parametrize_with_rows("ekf", beside=[3]), TypeError, "3 is no estimator"),
        (
            lambda: parametrize_with_checks("ekf", expected_failures={"speed": "slow"}),
            ValueError,
            "there is no check 'speed'; there are output, units",
        ),
    ],
)
def test_what_is_wrong_is_said_when_tests_are_collected(call, error: type[Exception], says: str):
    with pytest.raises(error, match=says):
        call()


def test_what_may_be_given(tmp_path):
    (tmp_path / "f.py").write_text('@register("mine")\nclass A: ...')
    assert list(factories(tmp_path / "f.py")) == ["mine"]

    def mine():
        raise AssertionError("nothing is made while tests are collected")

    labels = list(
        factories([mine, "my_filter.py:MyFilter", Path("a") / "b.py", ("ekf", {"calibrate": False}), "ekf", mine])
    )
    assert labels == ["mine", "my_filter:MyFilter", "b", "ekf(calibrate=False)", "ekf", "mine-2"]
    assert factories("gnss-only")["gnss-only"]().name == "gnss-only"
    assert factories(("gnss-only", {"acceleration": 0.5}))["gnss-only(acceleration=0.5)"]().name == "gnss-only"
