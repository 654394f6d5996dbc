"""Ranges to beacons on the sea floor: equation, travel times, clock, shadows and echoes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from simnav.blocks import NAVIGATION
from simnav.geometry.earth import displace
from simnav.geometry.ecef import ecef_from_geodetic
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy
from simnav.kinds import NavigationPoint
from simnav.sensors import AcousticRange
from simnav.sensors.acoustic_range import observe
from simnav.sensors.acoustics import separation
from simnav.sensors.channels import ChannelInstrument
from simnav.spec import SpecError
from simnav.types import Array, TapStates
from simnav.world.sound_speed import Profile
from simnav.world.surroundings import FlatBottom, Surroundings

ORIGIN = np.array([np.radians(54.0), np.radians(7.9), 0.0])
BEACONS: dict[str, Any] = {
    "latitude_deg": 54.0, "longitude_deg": 7.9, "beacons": ["A", "B", "C"], "north_m": [300.0, -250.0, 0.0],
    "east_m": [0.0, 200.0, -1000.0], "depth_m": [50.0, 65.0, 50.0], "sigma_m": 0.0,
}  # fmt: skip
ARCTIC = Profile(np.array([0.0, 400.0]), np.array([1440.0, 1446.0]))


def taps(n: int, offset: Any = (0.0, 0.0, 50.0), attitude: Any = (0.0, 0.0, 0.0), rate: float = 0.1) -> TapStates:
    """A vehicle that stays north, east and below the origin [m]."""
    place = np.broadcast_to(displace(ORIGIN, np.array(offset, dtype=float)), (n, 3)).copy()
    zero = np.zeros((n, 3))
    turned = np.broadcast_to(np.array(attitude, dtype=float), (n, 3)).copy()
    return TapStates(np.arange(n) / rate, place, zero, turned, zero.copy(), zero.copy())


def device(seed: int = 1, parts: dict[str, Any] | None = None, **table: Any) -> ChannelInstrument:
    """The transducer of one run."""
    made = AcousticRange.from_toml(BEACONS | table).install("ranges", seed, Surroundings(parts or {}))
    assert isinstance(made, ChannelInstrument)
    return made


@pytest.mark.parametrize("way", ["one_way", "two_way"])
def test_the_equation_predicts_the_range_and_its_derivatives(way: str) -> None:
    clock: dict[str, Any] = {"clock_s": 0.01, "clock_drift_ppm": 1.0} if way == "one_way" else {}
    ranges = device(3, way=way, sound_speed_percent=0.3, beacon_error_m=0.5, lever_arm_m=[1.0, -0.5, 0.4], **clock)
    tap = taps(1, (20.0, -30.0, 20.0), (0.1, -0.05, 0.8))
    stream = ranges.sense(tap)
    blocks = {b.name: ranges.block(b.name, tap.time)[0] for b in ranges.sheet.blocks}
    assert set(blocks) == {"sound_speed", "beacons"} | ({"clock"} if clock else set())
    dcm, row = dcm_from_rpy(tap.attitude)[0], np.zeros(3)
    for channel, reading in zip("ABC", stream.value, strict=True):
        point = NavigationPoint(0.0, tap.position[0], row, dcm, row, blocks, channel)

        def at(
            offset: Any = row, turn: Any = row, point: NavigationPoint = point, **more: Any
        ) -> tuple[Array, dict[str, Array]]:
            changed = {name: value + more.get(name, 0.0) for name, value in blocks.items()}
            place = displace(point.position, np.asarray(offset))
            turned = dcm_from_rotation_vector(np.asarray(turn)) @ dcm
            found = observe(point._replace(position=place, dcm=turned, blocks=changed), ranges.sheet)
            assert found is not None
            return found

        predicted, jacobian = at()
        np.testing.assert_allclose(reading, predicted, atol=1e-3)
        for k, e in enumerate(np.eye(3)):
            assert (at(offset=1e-2 * e)[0] - predicted)[0] / 1e-2 == pytest.approx(jacobian[NAVIGATION][0, k], abs=1e-3)
            assert (at(turn=1e-5 * e)[0] - predicted)[0] / 1e-5 == pytest.approx(
                jacobian[NAVIGATION][0, 6 + k], abs=1e-3
            )
        for name, value in blocks.items():
            for k, e in enumerate(1e-4 * np.eye(len(value))):
                slope = (at(**{name: e})[0] - predicted)[0] / 1e-4
                assert slope == pytest.approx(jacobian[name][0, k], abs=1e-3)


def test_a_two_way_range_is_late_by_one_way_of_the_sound() -> None:
    stream = device().sense(taps(2))
    np.testing.assert_allclose(stream.value[:, 0], np.tile([300.0, np.hypot(320.156, 15.0), 1000.0], 2), atol=0.1)
    np.testing.assert_allclose(stream.arrivals - stream.time, stream.value[:, 0] / 1500.0, rtol=1e-4)
    timing = AcousticRange.from_toml(BEACONS).datasheet("ranges").timing
    assert timing is not None
    assert timing.longest >= 2.0
    one_way = device(way="one_way")
    np.testing.assert_array_equal(one_way.sense(taps(2)).arrivals, [0.0] * 3 + [10.0] * 3)
    assert AcousticRange.from_toml(BEACONS | {"way": "one_way"}).datasheet("ranges").timing is None


def test_the_clock_of_one_way_ranges_drifts() -> None:
    stream = device(5, way="one_way", clock_s=0.001, clock_drift_ppm=10.0).sense(taps(100))
    error = stream.value[stream.channel == 0, 0] - 300.0
    assert error[-1] - error[0] == pytest.approx(99.0 * (error[1] - error[0]), rel=1e-6)
    offsets = [device(seed, way="one_way", clock_s=0.001).sense(taps(1)).value[0, 0] - 300.0 for seed in range(60)]
    assert np.std(offsets) == pytest.approx(1.5, rel=0.25)


def test_rays_bend_and_beacons_lie_in_shadows() -> None:
    bent = {"sound_speed_profile": ARCTIC}
    value = device(parts=bent).sense(taps(1)).value[:, 0]
    np.testing.assert_allclose(value, device().sense(taps(1)).value[:, 0], rtol=1e-12)
    fixed = device(parts=bent, correction="fixed", assumed_speed_m_s=1442.0).sense(taps(1)).value[:, 0]
    np.testing.assert_allclose(fixed, value * 1442.0 / ARCTIC.at(np.array([50.0]))[0], rtol=1e-4)
    # Over 1000 m the ray to beacon C would turn 1.3 m below both, which is below the bottom.
    stream = device(parts=bent | {"bottom": FlatBottom(51.0)}).sense(taps(1))
    assert stream.channel.tolist() == [0, 1]
    assert stream.dropped_channel.tolist() == [2]


def test_echoes_are_too_long_and_have_labels() -> None:
    ranges = device(reflections=0.05, detour_m=20.0)
    ranges.bit = 1
    stream = ranges.sense(taps(1000))
    false = stream.faults == 2
    assert 0.035 < false.mean() < 0.065
    assert (stream.fault_error[false] > 0.0).all()
    assert not stream.fault_error[~false].any()
    assert stream.fault_error[false].mean() == pytest.approx(20.0, rel=0.25)
    assert len(device(reach_m=400.0).sense(taps(10))) == 20


def test_distances_are_those_of_the_ellipsoid() -> None:
    north, east = np.radians([78.0, 78.012]), np.radians([179.99, -179.96])
    first, second = (np.array([north[k], east[k], -50.0]) for k in (0, 1))
    expected = np.linalg.norm(ecef_from_geodetic(second) - ecef_from_geodetic(first))
    assert 1500.0 < expected < 2000.0
    for a, b in ((first, second), (second, first)):
        assert np.linalg.norm(separation(a, b)) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"assumed_speed_m_s": 0.0}, "assumed_speed_m_s = 0"),
        ({"east_m": [0.0, 1.0]}, "beacon 'C' has no place: north_m, east_m and depth_m have 3, 2 and 3 numbers"),
        ({"depth_m": [50.0, -3.0, 50.0]}, "depth_m of beacon 'B' = -3: it is above the surface"),
        ({"beacons": []}, r"beacons = \[\]"),
        ({"clock_s": 0.1}, "way = 'two_way': a two-way travel time is measured by one clock"),
        ({"beacons": ["A", "A", "B"]}, "channel 'A' is there more than once"),
    ],
)
def test_bad_input_gets_a_sentence(table: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        AcousticRange.from_toml(BEACONS | table)
