"""The draws are repeatable and as varied as they say; a start that is turned knows by how much."""

from __future__ import annotations

import numpy as np
import pytest

import simnav
from simnav.geometry.rotation import wrap_angle
from simnav.scenario import parse
from tests.agreement.voyages import turned, voyage, voyage_of


def test_a_number_is_a_voyage():
    assert voyage(7) == voyage(7)
    assert voyage(7) != voyage(8)
    drawn = [voyage(k)[1] for k in range(60)]
    assert {d["vessel"] for d in drawn} == {"ship", "auv", "rov", "boat"}
    for name, low, high in (("heading_deg", 0.1, 45.0), ("dvl_hz", 1.0, 25.0), ("gnss_hz", 0.2, 10.0)):
        values = [d[name] for d in drawn]
        assert low <= min(values) < 3.0 * low
        assert high / 3.0 < max(values) <= high
    assert all(2.0 <= voyage(k, 2.0, 3.0)[1]["heading_deg"] <= 3.0 for k in range(10))


@pytest.mark.parametrize("off", [90.0, -170.0])
def test_a_turned_start_is_off_by_the_angle_and_knows_it(off: float):
    scenario = parse(voyage(3)[0]).model_copy(update={"duration": 5.0})
    recording = simnav.record(scenario, 3)
    start = turned(recording, off).start
    error = wrap_angle(start.attitude[2] - recording.initial_truth.attitude[0, 2])
    assert np.degrees(error) == pytest.approx(off)
    assert np.degrees(np.sqrt(start.covariance[8, 8])) == pytest.approx(abs(off))
    np.testing.assert_array_equal(start.position, recording.start.position)
    np.testing.assert_array_equal(start.covariance[:8, :8], recording.start.covariance[:8, :8])


def test_a_family_gives_the_same_voyages_as_a_campaign():
    recording, row = voyage_of("clean-voyages", 3, (2.0, 3.0))
    assert row["draws"] == simnav.load("clean-voyages").drawn(3).draws | {"draw.heading": row["heading_deg"]}
    assert 2.0 <= row["heading_deg"] <= 3.0
    assert recording.faults == ()
    assert recording.actual is None
