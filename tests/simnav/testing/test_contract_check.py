"""The contract test finds each way of breaking the contract, and passes what keeps it."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import Estimator, UnsuitableScenario
from simnav.testing.contract_check import CHECKS, Candidate, check, contract_recording
from simnav.types import KINDS, Estimate, NavigationStates


class Good(Estimator):
    """The initial velocity, carried on."""

    needs = ("gnss_position",)

    def reset(self, start, instruments):
        self.start = start
        self.gnss = instruments.of_kind("gnss_position")
        self.position = start.position.copy()

    def update(self, measurements):
        fix = measurements.latest("gnss_position")
        if fix is not None:
            self.position = fix.value.copy()
        return Estimate(measurements.time, self.position, covariance=np.eye(9))


class WrongTime(Good):
    def update(self, measurements):
        return Estimate(measurements.start, self.position)


class WrongShape(Good):
    def update(self, measurements):
        return Estimate(measurements.time, self.position[:2])


class NotFinite(Good):
    def update(self, measurements):
        return Estimate(measurements.time, np.full(3, np.nan))


class BadCovariance(Good):
    def update(self, measurements):
        return Estimate(measurements.time, self.position, covariance=np.diag([-1.0] + 8 * [1.0]))


class Silent(Good):
    def update(self, measurements):
        return Estimate(measurements.time)


class Degrees(Good):
    def update(self, measurements):
        return Estimate(measurements.time, self.position * [180 / np.pi, 180 / np.pi, 1.0])


class YawInDegrees(Good):
    def update(self, measurements):
        return Estimate(measurements.time, self.position, attitude=np.degrees(self.start.attitude))


class YawFarOff(Good):
    def update(self, measurements):
        return Estimate(measurements.time, self.position, attitude=np.add(self.start.attitude, [0.0, 0.0, 0.69]))


class AtRest(Good):
    def update(self, measurements):
        return Estimate(measurements.time, self.position, np.zeros(3))


class Knots(Good):
    def update(self, measurements):
        return Estimate(measurements.time, self.position, self.start.velocity * 100.0)


class Random(Good):
    def update(self, measurements):
        return Estimate(measurements.time, self.position + np.array([0.0, 0.0, np.random.default_rng().normal()]))


class RandomFlags(Good):
    def update(self, measurements):
        estimate = super().update(measurements)
        estimate.flagged = [("gnss_position", measurements.time)] * int(np.random.default_rng().integers(0, 9))
        return estimate


class RandomDiagnostic(Good):
    def update(self, measurements):
        estimate = super().update(measurements)
        estimate.diagnostics = {"drawn": np.random.default_rng().normal()}
        return estimate


class RandomSmoother(Good):
    def reset(self, start, instruments):
        super().reset(start, instruments)
        self.times = []

    def update(self, measurements):
        self.times.append(measurements.time)
        return super().update(measurements)

    def smooth(self):
        n = len(self.times)
        position = np.tile(self.start.position, (n, 1)) + np.random.default_rng().normal(0.0, 1e-9, (n, 3))
        return NavigationStates(np.array(self.times), position, np.full((n, 3), np.nan), np.full((n, 3), np.nan))


class Forgetful(Good):
    total = 0.0

    def update(self, measurements):
        self.total += 1.0
        return Estimate(measurements.time, self.position + np.array([0.0, 0.0, 1e-3 * self.total]))


class Prophet(Good):
    """Looks beyond the slice that it is given."""

    def update(self, measurements):
        ahead = measurements.imu.specific_force.base
        mean = 0.0 if ahead is None else float(ahead.mean())
        return Estimate(measurements.time, self.position + np.array([0.0, 0.0, mean]))


class Vandal(Good):
    def update(self, measurements):
        for m in measurements:
            if m.kind == "depth":
                m.value[...] += 1.0
        return super().update(measurements)


class Emptying(Good):
    def update(self, measurements):
        estimate = super().update(measurements)
        measurements.aids.clear()
        return estimate


class AliasingDiagnostic(Good):
    def reset(self, start, instruments):
        super().reset(start, instruments)
        self.count = np.zeros(2)

    def update(self, measurements):
        self.count += 1.0
        estimate = super().update(measurements)
        estimate.diagnostics = {"count": self.count}
        return estimate


class Aliasing(Good):
    def update(self, measurements):
        self.position += [0.0, 0.0, 0.1]
        return Estimate(measurements.time, self.position)


class NeedsData(Good):
    def update(self, measurements):
        return Estimate(measurements.time, measurements.latest("gnss_position").value)


class NeedsDvl(Good):
    def reset(self, start, instruments):
        super().reset(start, instruments)
        self.dvl = instruments["dvl"]


class Picky(Good):
    def reset(self, start, instruments):
        if "dvl" not in instruments:
            raise UnsuitableScenario("it wants a DVL")
        super().reset(start, instruments)


def test_a_good_one_passes():
    report = check(Good)
    assert report.passed, str(report)
    names = [f.name for f in report.findings]
    assert names == [
        "output", "units", "determinism", "reset", "causality", "input", "estimates", "silence", "missing instruments",
    ]  # fmt: skip
    assert str(report).endswith("Good passes the contract test")
    assert report.findings[-1].sentence == (
        "it declares that it cannot run without gnss_position, or without aiding instruments, or without instruments"
    )


@pytest.mark.parametrize(
    ("cls", "finding", "words"),
    [
        (WrongTime, "output", "time"),
        (WrongShape, "output", "shape (2,)"),
        (NotFinite, "output", "not finite"),
        (BadCovariance, "output", "negative variance"),
        (Silent, "output", "estimates nothing"),
        (Degrees, "units", "latitude, longitude [rad]"),
        (YawInDegrees, "units", "yaw is 40.3 rad after a second"),
        (YawFarOff, "units", "yaw is 1.39 rad after a second; the initial state has 0.703 rad"),
        (AtRest, "units", "velocity north is 0 m/s after a second; the initial state has 3.76 m/s"),
        (Knots, "units", "velocity"),
        (Random, "determinism", "position differs at 1 s"),
        (RandomFlags, "determinism", "flagged differs at"),
        (RandomDiagnostic, "determinism", "the diagnostic 'drawn' differs at 1 s"),
        (RandomSmoother, "determinism", "position of the smoothed trajectory differs"),
        (Forgetful, "reset", "position differs at 1 s"),
        (Prophet, "causality", "position differs at 1 s"),
        (Vandal, "input", "the measurements of depth"),
        (Emptying, "input", "the list of measurements"),
        (AliasingDiagnostic, "estimates", "the diagnostic 'count' differs at 1 s"),
        (Aliasing, "estimates", "copy it"),
        (NeedsData, "silence", "after every aiding instrument stopped: error"),
        (NeedsDvl, "missing instruments", "without dvl: error"),
        (Picky, "missing instruments", "without dvl: error: reset(): it refuses a scenario that has all instruments"),
    ],
)
def test_each_breach_is_found(cls: type[Estimator], finding: str, words: str):
    report = check(cls)
    assert not report.passed
    failed = {f.name: f.sentence for f in report.findings if not f.ok}
    assert finding in failed, str(report)
    assert words in failed[finding], failed[finding]
    assert "FAIL" in str(report)


def test_each_check_has_a_name_and_a_sentence():
    report = check(Good)
    assert [c.name for c in CHECKS] == [f.name for f in report.findings]
    assert len({c.sentence for c in CHECKS}) == len(CHECKS)
    for c in CHECKS:
        assert c.sentence[0].isupper()
        assert c.sentence.endswith(".")
        assert "\n" not in c.sentence


def test_a_check_on_its_own_finds_what_the_report_finds():
    (causality,) = (c for c in CHECKS if c.name == "causality")
    (found,) = (f for f in check(Prophet).findings if f.name == "causality")
    assert causality(Candidate(Prophet)) == found
    assert not found.ok


def test_what_a_check_lets_an_estimator_spoil_does_not_reach_the_next():
    candidate = Candidate(Vandal)
    depth = candidate.recording.data.aids["depth"].value.copy()
    assert not all(c(candidate).ok for c in CHECKS)
    np.testing.assert_array_equal(candidate.recording.data.aids["depth"].value, depth)


def test_checks_that_would_repeat_a_bad_output_are_left_out():
    short = Candidate(WrongShape)
    assert [c.name for c in CHECKS if not c.left_out(short)] == ["output"]
    assert [c.name for c in CHECKS if not c.left_out(Candidate(Degrees))] == ["output", "units"]


@pytest.mark.parametrize(
    ("cls", "breach"),
    [(Random, "determinism"), (RandomSmoother, "determinism"), (Vandal, "input"), (Forgetful, "reset")],
)  # fmt: skip
def test_one_breach_is_one_finding(cls: type[Estimator], breach: str):
    assert [f.name for f in check(cls).findings if not f.ok] == [breach]


def test_a_name_with_parameters():
    assert check("gnss-only", acceleration="0.5").passed


def test_the_recording_has_every_kind_of_instrument():
    recording = contract_recording(0)
    assert {s.kind for s in recording.instruments.values()} == set(KINDS)
    assert recording.instruments.imu is not None
    # Over a level bottom no profile of depths can be matched.
    assert all(len(s) > 3 for s in recording.data.aids.values() if s.kind != "terrain_match")
