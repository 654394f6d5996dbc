"""Fixes of an ultra-short baseline under a ship: figures of their classes, equation, latency, cone and echoes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from simnav.blocks import NAVIGATION
from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy
from simnav.kinds import NavigationPoint
from simnav.sensors import UsblFix
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.faults.by_channel import each_channel
from simnav.sensors.usbl_fix import GRADES, observe
from simnav.spec import SpecError
from simnav.types import Array, TapStates
from simnav.world.sound_speed import Profile
from simnav.world.surroundings import Surroundings

PLACE: dict[str, Any] = {"latitude_deg": 54.0, "longitude_deg": 7.9}
ORIGIN = np.array([np.radians(54.0), np.radians(7.9), 0.0])
QUIET: dict[str, Any] = {"accuracy_percent": 0.0, "range_noise_m": 0.0, "sigma_m": 0.0}
SUMMER = Profile(np.array([0.0, 20.0, 60.0, 100.0]), np.array([1510.0, 1508.0, 1485.0, 1480.0]))


def taps(n: int, offset: Any, attitude: Any = (0.0, 0.0, 0.0), rate: float = 1.0) -> TapStates:
    """A vehicle that stays north, east and below the origin [m]."""
    place = np.broadcast_to(displace(ORIGIN, np.array(offset, dtype=float)), (n, 3)).copy()
    zero = np.zeros((n, 3))
    turned = np.broadcast_to(np.array(attitude, dtype=float), (n, 3)).copy()
    return TapStates(np.arange(n) / rate, place, zero, turned, zero.copy(), zero.copy())


def device(seed: int = 1, parts: dict[str, Any] | None = None, **table: Any) -> ChannelInstrument:
    """The transceiver of one run."""
    made = UsblFix.from_toml(PLACE | table).install("usbl", seed, Surroundings(parts or {}))
    assert isinstance(made, ChannelInstrument)
    return made


@pytest.mark.parametrize("grade", GRADES)
@pytest.mark.parametrize("offset", [(0.0, 0.0, 305.0), (150.0, -70.0, 105.0)])
def test_fixes_scatter_by_the_figure_of_the_class(grade: str, offset: tuple[float, float, float]) -> None:
    """Across the line of sight by a share of the slant range, within 10 %; what readings state is the same."""
    stream = device(grade=grade, sigma_m=0.0).sense(taps(4000, offset))
    error = relative_position(stream.value, displace(ORIGIN, np.array(offset)))
    sight = np.array(offset) - [0.0, 0.0, 5.0]
    slant = np.linalg.norm(sight)
    sight /= slant
    along = error @ sight
    across = error - along[:, None] * sight
    share = np.sqrt(np.mean(np.sum(across**2, axis=1)) / 2.0) / slant
    assert share == pytest.approx(GRADES[grade].accuracy, rel=0.04)
    assert 0.0008 < GRADES[grade].accuracy < 0.003
    assert along.std() == pytest.approx(GRADES[grade].range_noise, rel=0.04)
    np.testing.assert_allclose(stream.sigma.mean(axis=0), error.std(axis=0), rtol=0.05)
    np.testing.assert_allclose(stream.sigma[0], stream.sigma[-1], rtol=0.05)


def test_attitude_noise_and_the_position_of_the_ship_count() -> None:
    usbl = device(accuracy_percent=0.0, range_noise_m=0.0, sigma_m=[0.3, 0.4, 0.5], attitude_noise_deg=[0.1, 0.2, 0.3])
    stream = usbl.sense(taps(4000, (0.0, 200.0, 105.0)))
    error = relative_position(stream.value, displace(ORIGIN, np.array([0.0, 200.0, 105.0])))
    roll, pitch, yaw = np.radians([0.1, 0.2, 0.3])
    expected = np.sqrt(
        [0.09 + (100 * pitch) ** 2 + (200 * yaw) ** 2, 0.16 + (100 * roll) ** 2, 0.25 + (200 * roll) ** 2]
    )
    np.testing.assert_allclose(error.std(axis=0), expected, rtol=0.04)
    np.testing.assert_allclose(stream.sigma.mean(axis=0), expected, rtol=0.02)


def test_the_equation_predicts_the_fix_and_its_derivatives() -> None:
    usbl = device(
        3, **QUIET, alignment_deg=0.3, sound_speed_percent=0.3, lever_arm_m=[1.0, -0.5, 0.4], heading_deg=70.0
    )
    tap = taps(1, (150.0, -80.0, 90.0), (0.1, -0.05, 0.8))
    stream = usbl.sense(tap)
    blocks = {b.name: usbl.block(b.name, tap.time)[0] for b in usbl.sheet.blocks}
    dcm, row = dcm_from_rpy(tap.attitude)[0], np.zeros(3)
    point = NavigationPoint(0.0, tap.position[0], row, dcm, row, blocks, "transponder", stream.side[0])

    def at(offset: Any = row, turn: Any = row, **more: Any) -> tuple[Array, dict[str, Array]]:
        changed = {name: value + more.get(name, 0.0) for name, value in blocks.items()}
        place = displace(point.position, np.asarray(offset))
        turned = dcm_from_rotation_vector(np.asarray(turn)) @ dcm
        return observe(point._replace(position=place, dcm=turned, blocks=changed), usbl.sheet)

    reading, jacobian = at()
    assert np.linalg.norm(relative_position(stream.value[0], reading)) < 0.01
    for k, e in enumerate(1e-5 * np.eye(3)):
        slope = relative_position(at(offset=1e3 * e)[0], reading) / 1e-2
        np.testing.assert_allclose(slope, jacobian[NAVIGATION][:, k], atol=1e-4)
        slope = relative_position(at(turn=e)[0], reading) / 1e-5
        np.testing.assert_allclose(slope, jacobian[NAVIGATION][:, 6 + k], atol=1e-3)
        slope = relative_position(at(alignment=e)[0], reading) / 1e-5
        np.testing.assert_allclose(slope, jacobian["alignment"][:, k], atol=1.0)  # of 190 m, to first order
    slope = relative_position(at(sound_speed=1e-5)[0], reading) / 1e-5
    np.testing.assert_allclose(slope, jacobian["sound_speed"][:, 0], atol=1e-2)


def test_the_ship_sails_along_its_way_and_stops() -> None:
    usbl = device(**QUIET, north_m=[0.0, 100.0, 100.0], east_m=[0.0, 0.0, 50.0], speed_m_s=2.0, reach_m=5000.0)
    stream = usbl.sense(taps(101, (100.0, 50.0, 65.0)))
    # The ship's own error is none, so the measured vector in its axes tells where it is.
    forward, starboard, _, heading = stream.side.T
    np.testing.assert_allclose(forward[[10, 60, 100]], [80.0, 30.0, 0.0], atol=1e-3)
    np.testing.assert_allclose(starboard[[10, 60, 100]], [50.0, 0.0, 0.0], atol=1e-3)
    np.testing.assert_allclose(np.degrees(heading[[10, 60, 100]]), [0.0, 90.0, 90.0])


def test_a_fix_is_late_by_the_way_of_the_sound() -> None:
    tap = taps(3, (0.0, 0.0, 755.0), rate=0.5)
    for returned, times in (("sound", 2.0), ("cable", 1.0)):
        stream = device(returned=returned).sense(tap)
        np.testing.assert_allclose(stream.arrivals - stream.time, times * 750.0 / 1500.0)
        timing = UsblFix.from_toml(PLACE | {"returned": returned}).datasheet("usbl").timing
        assert timing is not None
        assert timing.longest >= times * 1000.0 / 1500.0


def test_an_interrogation_waits_for_the_answer_to_the_one_before() -> None:
    stream = device().sense(taps(9, (0.0, 0.0, 695.0), rate=2.0))  # 0.92 s there and back
    assert stream.time.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert stream.dropped.tolist() == [0.5, 1.5, 2.5, 3.5]


def test_fixes_that_a_fault_leaves_arrive_as_before() -> None:
    stream = device().sense(taps(6, (0.0, 0.0, 705.0)))
    left = each_channel(stream, (), lambda part: part.rows(part.time > 2.5))
    assert left.time.tolist() == [3.0, 4.0, 5.0]
    np.testing.assert_array_equal(left.arrival, stream.arrival[3:])


def test_there_is_no_fix_beyond_cone_and_reach_and_above_the_surface() -> None:
    for offset, there in (
        ((100.0, 0.0, 65.0), True), ((105.0, 0.0, 65.0), False), ((0.0, 0.0, 404.0), True), ((0.0, 0.0, 406.0), False),
        ((1.0, 0.0, -0.5), False),
    ):  # fmt: skip
        assert len(device(grade="simple", reach_m=400.0).sense(taps(1, offset))) == there
    assert len(device(cone_deg=100.0).sense(taps(1, (40.0, 0.0, 2.0)))) == 1
    assert len(device(cone_deg=100.0).sense(taps(1, (10.0, 0.0, 0.5)))) == 0


def test_bent_rays_are_an_error_of_devices_that_do_not_trace_them() -> None:
    offset = np.array([300.0, 0.0, 85.0])
    tap = taps(1, offset)
    errors = {}
    for correction in ("profile", "harmonic", "fixed"):
        usbl = device(parts={"sound_speed_profile": SUMMER}, **QUIET, correction=correction)
        found = usbl.sense(tap)
        errors[correction] = relative_position(found.value, displace(ORIGIN, offset))[0]
    assert np.linalg.norm(errors["profile"]) < 1e-6
    # Where the speed falls with depth rays bend down, so the sound arrives less steep than the line of sight.
    assert -14.0 < errors["harmonic"][2] < -1.0
    assert 0.1 < abs(errors["harmonic"][0]) < 3.0
    assert 0.5 < np.linalg.norm(errors["fixed"]) < 10.0


def test_echoes_are_gross_errors_with_labels() -> None:
    usbl, plain = device(reflections=0.1, detour_m=20.0), device()
    usbl.bit = 2
    tap = taps(3000, (60.0, 20.0, 105.0))
    stream, clean = usbl.sense(tap), plain.sense(tap)
    false = stream.faults == 4
    assert 0.08 < false.mean() < 0.12
    assert not stream.faults[~false].any()
    assert not stream.fault_error[~false].any()
    healthy = relative_position(usbl.definition.add_error(stream.value, -stream.fault_error), clean.value)
    np.testing.assert_allclose(healthy, 0.0, atol=3e-3)
    size = np.linalg.norm(stream.fault_error[false], axis=1)
    assert 15.0 < size.mean() < 30.0
    # The vector goes wrong with the fix: it is the one that was measured.
    assert np.corrcoef(np.linalg.norm(stream.side[:, :3], axis=1)[false], size)[0, 1] > 0.8


def test_the_division_into_blocks_changes_nothing() -> None:
    table: dict[str, Any] = {
        "reflections": 0.2,
        "bias_instability_m": 0.5,
        "correlation_time_s": 60.0,
        "attitude_noise_deg": 0.1,
    }
    tap, parts, usbl = taps(60, (60.0, 20.0, 105.0)), [], device(**table)
    whole = device(**table).sense(tap)
    for rows in (slice(0, 7), slice(7, 8), slice(8, 60)):
        parts.append(usbl.sense(TapStates(*(getattr(tap, f)[rows] for f in tap.__dataclass_fields__))))
    for field in ("value", "side", "sigma", "faults", "arrival"):
        np.testing.assert_array_equal(np.concatenate([getattr(p, field) for p in parts]), getattr(whole, field))


def test_an_ideal_device_has_no_error() -> None:
    spec = UsblFix.from_toml(PLACE | {"alignment_deg": 1.0, "attitude_noise_deg": 1.0, "correction": "fixed"}).ideal()
    tap = taps(2, (60.0, 20.0, 105.0))
    stream = spec.install("usbl", 1, Surroundings({"sound_speed_profile": SUMMER})).sense(tap)
    np.testing.assert_allclose(relative_position(stream.value, tap.position), 0.0, atol=1e-6)
    assert not stream.sigma.any()
    assert replace(stream).side[0, :3] == pytest.approx([60.0, 20.0, 100.0])


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"assumed_speed_m_s": 300.0}, "assumed_speed_m_s = 300: sound in water has 1350 to 1700 m/s"),
        ({"assumed_speed_m_s": 0.0}, "assumed_speed_m_s = 0"),
        ({"transceiver_depth_m": -2.0}, "transceiver_depth_m = -2: the transceiver should be below the surface"),
        ({"north_m": [0.0, 1.0], "speed_m_s": 1.0}, "north_m has 2 numbers and east_m 1"),
        ({"north_m": [0.0, 1.0], "east_m": [0.0, 1.0]}, "speed_m_s = 0: a ship with a track"),
        ({"north_m": [0.0, 0.0], "east_m": [1.0, 1.0], "speed_m_s": 1.0}, "are the same"),
        ({"grade": "perfect"}, "grade"),
        ({"reach_m": float("inf")}, "reach_m = inf"),
        ({"fixed_sound_speed_percent": -100.0}, "fixed_sound_speed_percent = -100"),
        ({"cone_deg": 0.0}, "cone_deg"),
    ],
)
def test_bad_input_gets_a_sentence(table: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        UsblFix.from_toml(PLACE | table)
