"""The self-test of rows that linearise ranges."""

from __future__ import annotations

import numpy as np

from simnav.estimators.range_test import RangeTest
from simnav.types import Datasheet, Estimate, Instruments, Measurement, Measurements
from tests.audit.self_test import CAUSES, ran

SIGMA, RANGE = 0.2, 400.0


def told(spreads: list[float], kind: str = "acoustic_range") -> list[bool]:
    """After each range, whether a position with these standard deviations north is called into question."""
    test = RangeTest(Instruments((Datasheet("lbl", kind, 0.5, np.array([SIGMA])),)))
    found = []
    for k, spread in enumerate(spreads):
        covariance = np.eye(9) * 1e-6
        covariance[0, 0] = spread**2
        estimate = Estimate(k + 1.0, np.zeros(3), covariance=covariance, diagnostics={"other": 1.0})
        reading = Measurement(k + 1.0, "lbl", kind, np.array([RANGE]))
        judged = test.judge(Measurements(float(k), k + 1.0, None, [reading]), estimate)
        assert judged.diagnostics == ({"other": 1.0, "inconsistent": 1.0} if test.curved else {"other": 1.0})
        found.append(test.curved)
    return found


def test_the_limit_is_that_of_the_noise_of_as_many_readings():
    """A term of c standard deviations in each of n readings adds up to more than their noise if c > 1 / sqrt(n)."""

    def of(share: float) -> float:
        return float(np.sqrt(share * 2.0 * RANGE * SIGMA))

    assert not any(told([of(0.05)] * 400))
    assert all(told([of(0.2)] * 100)[40:])
    assert any(told([of(0.1)] * 200))
    assert not any(told([of(0.1)] * 60))


def test_a_start_far_off_is_not_held_against_it_for_long():
    found = told([100.0] * 3 + [1.0] * 60)
    assert not any(found[45:])


def test_ranges_to_satellites_and_by_messages_are_not_looked_at():
    for kind, components in (("gnss_raw", 2), ("vessel_range", 1)):
        assert not RangeTest(Instruments((Datasheet("far", kind, 1.0, np.full(components, SIGMA)),)))


def test_a_row_that_is_lost_on_the_circle_about_one_beacon_says_so():
    beacon = CAUSES["one beacon"](9002)
    lost = ran(beacon, "ekf")
    assert lost is not None
    assert lost.lost
    assert lost.says
    points = ran(beacon, "ukf")  # takes its moments from points, so that the curve is in them
    assert points is not None
    assert not points.lost
    assert not points.says
