"""Ranges to another vessel with its messages: equation, travel times, errors of the other vessel, lost packets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from simnav.blocks import NAVIGATION
from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy
from simnav.kinds import NavigationPoint
from simnav.recording import AidStream
from simnav.sensors import VesselRange
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.planned_track import PlannedTrack
from simnav.sensors.vessel_range import message_noise, observe
from simnav.spec import SpecError
from simnav.types import Array, TapStates
from simnav.world.surroundings import Surroundings

ORIGIN = np.array([np.radians(54.0), np.radians(7.9), 0.0])
SHIP: dict[str, Any] = {
    "latitude_deg": 54.0, "longitude_deg": 7.9, "north_m": [300.0], "east_m": [0.0], "depth_m": 50.0, "sigma_m": 0.0,
}  # fmt: skip
QUIET: dict[str, Any] = {"position_noise_m": 0.0, "depth_noise_m": 0.0, "velocity_noise_m_s": 0.0}
SAILING: dict[str, Any] = {"north_m": [0.0, 6000.0], "east_m": [100.0, 100.0], "speed_m_s": 3.0, "reach_m": 9000.0}


def taps(n: int, offset: Any = (0.0, 0.0, 50.0), attitude: Any = (0.0, 0.0, 0.0), step: float = 1.0) -> TapStates:
    """A vehicle that stays north, east and below the origin [m]."""
    place = np.broadcast_to(displace(ORIGIN, np.array(offset, dtype=float)), (n, 3)).copy()
    zero = np.zeros((n, 3))
    turned = np.broadcast_to(np.array(attitude, dtype=float), (n, 3)).copy()
    return TapStates(step * np.arange(n), place, zero, turned, zero.copy(), zero.copy())


def device(seed: int = 1, **table: Any) -> ChannelInstrument:
    """The modem of one run."""
    made = VesselRange.from_toml(SHIP | table).install("modem", seed, Surroundings())
    assert isinstance(made, ChannelInstrument)
    return made


def errors_of(stream: AidStream, track: PlannedTrack, age: Array | float = 0.0) -> Array:
    """(n, 2) errors of the positions in the messages."""
    offset, _ = track.at(stream.time - age)
    true = displace(ORIGIN - np.array([0.0, 0.0, 50.0]), np.column_stack([offset, np.zeros(len(offset))]))
    return relative_position(stream.side[:, :3], true)[:, :2]


@pytest.mark.parametrize("way", ["one_way", "two_way"])
def test_the_equation_predicts_the_range_and_its_derivatives(way: str) -> None:
    clock = {"clock_s": 0.01, "clock_drift_ppm": 1.0} if way == "one_way" else {}
    more = {"wander_m": 2.0, "wander_time_s": 500.0, "declared": True, "age_s": 1.5}
    modem = device(3, **SAILING, **QUIET, **more, **clock, way=way, sound_speed_percent=0.3, lever_arm_m=[1, -0.5, 0.4])
    tap = taps(20, (20.0, -30.0, 20.0), (0.1, -0.05, 0.8), step=4.0)
    stream = modem.sense(tap)
    k = len(stream.time) - 1
    blocks = {b.name: modem.block(b.name, stream.time[k:])[0] for b in modem.sheet.blocks}
    if way == "one_way":  # the slow error is that of the time of the message; it has moved little since
        assert set(blocks) == {"sound_speed", "vessel", "clock"}
    dcm, row = dcm_from_rpy(tap.attitude)[0], np.zeros(3)
    point = NavigationPoint(0.0, tap.position[0], row, dcm, row, blocks, "ship", stream.side[k])

    def at(offset: Any = row, turn: Any = row, **moved: Any) -> tuple[Array, dict[str, Array]]:
        changed = {name: value + moved.get(name, 0.0) for name, value in blocks.items()}
        place = displace(point.position, np.asarray(offset))
        turned = dcm_from_rotation_vector(np.asarray(turn)) @ dcm
        found = observe(point._replace(position=place, dcm=turned, blocks=changed), modem.sheet)
        assert found is not None
        return found

    predicted, jacobian = at()
    np.testing.assert_allclose(stream.value[k], predicted, atol=0.4)  # by the way of the slow error in 1.5 s
    for i, e in enumerate(np.eye(3)):
        slope = (at(offset=1e-2 * e)[0] - predicted)[0] / 1e-2
        assert slope == pytest.approx(jacobian[NAVIGATION][0, i], abs=1e-3)
        slope = (at(turn=1e-5 * e)[0] - predicted)[0] / 1e-5
        assert slope == pytest.approx(jacobian[NAVIGATION][0, 6 + i], abs=1e-3)
    for name, value in blocks.items():
        for i, e in enumerate(1e-4 * np.eye(len(value))):
            slope = (at(**{name: e})[0] - predicted)[0] / 1e-4
            assert slope == pytest.approx(jacobian[name][0, i], rel=1e-4, abs=1e-3)


def test_the_noise_of_a_message_is_its_covariance_along_the_line_of_sight() -> None:
    modem = device(age_s=2.0, velocity_noise_m_s=0.1)
    side = device(age_s=2.0, **QUIET).sense(taps(1)).side[0]
    side[6:10] = 3.0, 2.0, 0.5, 0.6
    point = NavigationPoint(0.0, displace(ORIGIN, np.array([0.0, 0.0, 50.0])), np.zeros(3), np.eye(3), np.zeros(3))
    covariance = np.array([[9.0, 3.6, 0.0], [3.6, 4.0, 0.0], [0.0, 0.0, 0.25]])
    for place in ((0.0, 0.0, 50.0), (100.0, 250.0, 120.0), (300.0, -70.0, 50.0)):
        here = point._replace(position=displace(ORIGIN, np.array(place)), side=side)
        sight = np.array([300.0, 0.0, 50.0]) - place
        sight /= np.linalg.norm(sight)
        expected = sight @ covariance @ sight + 0.04 * (sight[:2] @ sight[:2])
        assert message_noise(here, modem.sheet)[0, 0] == pytest.approx(expected, rel=0.01)


def test_the_sound_takes_its_time() -> None:
    track = PlannedTrack([0.0, 6000.0], [100.0, 100.0], 3.0)
    one, two = (device(**SAILING, **QUIET, way=way).sense(taps(60, step=10.0)) for way in ("one_way", "two_way"))
    np.testing.assert_array_equal(one.arrivals, one.time)
    np.testing.assert_allclose(two.arrivals - two.time, two.value[:, 0] / 1500.0, rtol=1e-9)
    # One way, the message is that of the time at which the sound left, and so is the range.
    np.testing.assert_allclose(errors_of(one, track, one.value[:, 0] / 1500.0), 0.0, atol=1e-3)
    np.testing.assert_allclose(errors_of(two, track), 0.0, atol=1e-3)
    north = 3.0 * (one.time - one.value[:, 0] / 1500.0)
    np.testing.assert_allclose(one.value[:, 0], np.hypot(north, 100.0), atol=0.02)
    sheet = VesselRange.from_toml(SHIP).datasheet("modem")
    assert sheet.timing is not None
    assert sheet.timing.longest >= 2000.0 / 1500.0


def test_the_error_of_a_ship_is_common_to_its_messages() -> None:
    table = {"position_noise_m": 0.5, "wander_m": 3.0, "wander_time_s": 200.0, "repeats": True, "way": "one_way"}
    lies = {"north_m": [300.0, 301.0], "east_m": [0.0, 0.0], "speed_m_s": 1e-9}
    stream = device(7, **table, **lies).sense(taps(2500, step=10.0))
    error = errors_of(stream, PlannedTrack([300.0], [0.0], 0.0))
    np.testing.assert_allclose(error.std(axis=0), np.hypot(3.0, 0.5), rtol=0.2)
    np.testing.assert_allclose(stream.side[:, 6:8], np.hypot(3.0, 0.5))
    for lag in (1, 10, 30):
        together = np.mean(error[:-lag] * error[lag:], axis=0) / 9.0
        np.testing.assert_allclose(together, np.exp(-lag * 10.0 / 200.0), atol=0.25)
    stated = device(7, **table, **lies, stated_ratio=0.5).sense(taps(3, step=10.0))
    np.testing.assert_allclose(stated.side[:, 6:9], 0.5 * stream.side[:3, 6:9])
    np.testing.assert_array_equal(stated.side[:, :6], stream.side[:3, :6])


def test_the_drift_of_a_second_auv_grows_with_its_way_until_it_gets_a_fix() -> None:
    table = {
        "navigation": "dead_reckoning", "position_noise_m": 0.3, "drift_percent": [0.3, 0.9], "walk_m_sqrt_s": 0.02,
        "fixes_s": [900.0], "way": "one_way", "vessel": "auv-2",
    } | SAILING  # fmt: skip
    track = PlannedTrack([0.0, 6000.0], [100.0, 100.0], 3.0)
    seeds, at = range(60), [0, 6, 8, 10, 14]
    found, sheet = [], np.empty(0)
    for seed in seeds:
        stream = device(seed, **table).sense(taps(15, step=100.0))
        found.append(errors_of(stream, track, stream.value[:, 0] / 1500.0)[at])
        sheet = stream.side[at]
    spread = np.std(found, axis=0)
    np.testing.assert_allclose(spread, sheet[:, 6:8], rtol=0.3)
    along, across = np.hypot(np.hypot(0.3, 0.003 * 2400.0), 0.02 * 800.0**0.5), np.hypot(0.3, 0.009 * 2400.0)
    np.testing.assert_allclose(sheet[2, 6:8], [along, np.hypot(across, 0.02 * 800.0**0.5)], rtol=0.01)
    assert (sheet[3, 6:8] < 0.3 * sheet[2, 6:8]).all()
    # The drift of one run goes on in the same direction.
    runs = np.array(found)
    assert np.corrcoef(runs[:, 1, 1], runs[:, 2, 1])[0, 1] > 0.95


def test_packets_are_lost_and_echoes_are_too_long() -> None:
    modem = device(losses=0.3, reflections=0.05, detour_m=20.0, way="one_way")
    modem.bit = 1
    stream = modem.sense(taps(3000))
    assert 0.27 < len(stream.dropped) / 3000 < 0.33
    false = stream.faults == 2
    assert 0.035 < false.mean() < 0.065
    assert (stream.fault_error[false] > 0.0).all()
    plain = device(way="one_way").sense(taps(3000))
    kept = np.isin(plain.time, stream.time)
    np.testing.assert_array_equal(plain.side[kept], stream.side)  # a lost packet changes no other one


def test_the_division_into_blocks_changes_nothing() -> None:
    table = {"wander_m": 2.0, "wander_time_s": 60.0, "losses": 0.2, "reflections": 0.1, "north_m": [300.0, 600.0]}
    table |= {"east_m": [0.0, 40.0], "speed_m_s": 2.0, "repeats": True}
    tap, parts, modem = taps(60), [], device(**table)
    whole = device(**table).sense(tap)
    for rows in (slice(0, 7), slice(7, 8), slice(8, 60)):
        parts.append(modem.sense(TapStates(*(getattr(tap, f)[rows] for f in tap.__dataclass_fields__))))
    for field in ("value", "side", "sigma", "faults", "arrival", "dropped"):
        np.testing.assert_array_equal(np.concatenate([getattr(p, field) for p in parts]), getattr(whole, field))


def test_an_ideal_modem_has_no_error() -> None:
    table = {"wander_m": 2.0, "clock_s": 0.1, "way": "one_way", "sound_speed_percent": 1.0, "correction": "fixed"}
    stream = VesselRange.from_toml(SHIP | table).ideal().install("modem", 1, Surroundings()).sense(taps(3))
    np.testing.assert_allclose(stream.value, 300.0, atol=1e-3)
    np.testing.assert_allclose(errors_of(stream, PlannedTrack([300.0], [0.0], 0.0)), 0.0, atol=1e-6)
    assert not stream.side[:, 6:].any()


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"depth_m": -2.0}, "depth_m = -2: the transducer of the other vessel should be below the surface"),
        ({"east_m": [0.0, 1.0]}, "north_m has 1 numbers and east_m 2"),
        ({"north_m": [0.0, 1.0], "east_m": [0.0, 1.0]}, "speed_m_s = 0: a ship with a track"),
        ({"repeats": True}, "repeats = true: a way that is sailed again and again has two points or more"),
        ({"clock_s": 0.1}, "way = 'two_way': a two-way travel time is measured by one clock"),
        ({"drift_percent": 0.5}, "drift_percent: a vessel with navigation = 'gnss' has none"),
        ({"navigation": "dead_reckoning", "wander_m": 1.0}, "wander_m: a vessel with navigation = 'dead_reckoning'"),
        ({"navigation": "dead_reckoning", "declared": True}, "declared: a vessel with navigation = 'dead_reckoning'"),
        ({"navigation": "dead_reckoning", "fixes_s": [50.0, 20.0]}, r"fixes_s = \[50.0, 20.0\]: times of fixes"),
        ({"vessel": "two words"}, "identifiers of letters"),
        ({"losses": 1.5}, "losses"),
    ],
)
def test_bad_input_gets_a_sentence(table: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        VesselRange.from_toml(SHIP | table)
