"""Altimeters and profiles of a multibeam echo sounder: geometry, equation, noise, false and lost readings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from simnav.blocks import NAVIGATION
from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy
from simnav.kinds import NavigationPoint
from simnav.scenario import Scenario
from simnav.sensors import Altimeter, MultibeamProfile
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.errors import InstrumentError
from simnav.sensors.soundings import observe, soundings
from simnav.source import record
from simnav.spec import SpecError
from simnav.types import Array, TapStates
from simnav.world.bathymetry import Bottom
from simnav.world.depth_grid import DepthGrid, grid_of
from simnav.world.surroundings import FlatBottom, Surroundings

PLACE: dict[str, Any] = {"latitude_deg": 54.0, "longitude_deg": 7.9}
ORIGIN = np.array([np.radians(54.0), np.radians(7.9), 0.0])
NORTH = 10.0 * np.arange(-40, 41)
QUIET: dict[str, Any] = {"sigma_m": 0.0, "range_noise_percent": 0.0}


def slope(gradient: float = 0.2, depth: float = 100.0) -> DepthGrid:
    """A plane that becomes deeper northwards."""
    return DepthGrid(ORIGIN, np.array([10.0, 10.0]), np.repeat(depth + gradient * NORTH[:, None], 81, axis=1))


def hills() -> DepthGrid:
    north, east = np.meshgrid(NORTH, NORTH, indexing="ij")
    return DepthGrid(ORIGIN, np.array([10.0, 10.0]), 90.0 + 6.0 * np.sin(north / 40.0) * np.cos(east / 55.0))


def taps(n: int, offset: Any = (0.0, 0.0, 40.0), attitude: Any = (0.0, 0.0, 0.0)) -> TapStates:
    """A vehicle that stays north, east and below the origin [m]."""
    place = np.broadcast_to(displace(ORIGIN, np.array(offset, dtype=float)), (n, 3)).copy()
    zero = np.zeros((n, 3))
    turned = np.broadcast_to(np.array(attitude, dtype=float), (n, 3)).copy()
    return TapStates(np.arange(n) * 1.0, place, zero, turned, zero.copy(), zero.copy())


def device(bottom: Any, seed: int = 1, spec: Any = Altimeter, **table: Any) -> ChannelInstrument:
    made = spec.from_toml(table).install("sounder", seed, Surroundings({"bottom": bottom}))
    assert isinstance(made, ChannelInstrument)
    return made


def test_the_distance_to_a_slope_is_that_of_geometry() -> None:
    """60 m above a slope of 20 %: vertically, along a body that pitches, and the first echo of a wide beam."""
    bottom, pitch = Bottom(slope()), np.radians(10.0)
    along = 60.0 / (np.cos(pitch) - 0.2 * np.sin(pitch))  # bow up: the beam points forward
    perpendicular = 60.0 * np.cos(np.arctan(0.2))
    for table, attitude, expected in (
        ({"axis": "vertical"}, (0.0, pitch, 0.0), 60.0),
        ({}, (0.0, pitch, 0.0), along),
        ({"axis": "vertical", "beam_width_deg": 40.0}, (0.0, 0.0, 0.0), None),
    ):
        value = device(bottom, **QUIET, **table).sense(taps(1, attitude=attitude)).value
        if expected is not None:
            assert value.item() == pytest.approx(expected, abs=2e-3)
        else:  # the nearest of nine rays, of which one comes at 20 degrees and the perpendicular is at 11.3
            assert perpendicular < value.item() < 60.0


def test_beams_go_from_port_to_starboard() -> None:
    east = DepthGrid(ORIGIN, np.array([10.0, 10.0]), slope().depth.T)
    profile = device(Bottom(east), spec=MultibeamProfile, **QUIET, beams=3, swath_deg=60.0)
    port, down, starboard = profile.sense(taps(1)).value[:, 0]
    angle = np.radians(30.0)
    expected = [60.0 / (np.cos(angle) - sign * 0.2 * np.sin(angle)) for sign in (-1.0, 1.0)]
    np.testing.assert_allclose([port, down, starboard], [expected[0], 60.0, expected[1]], atol=2e-3)
    south = device(Bottom(east), spec=MultibeamProfile, **QUIET, beams=3, swath_deg=60.0)
    np.testing.assert_allclose(south.sense(taps(1, attitude=(0, 0, np.pi))).value[:, 0], [starboard, down, port])


@pytest.mark.parametrize("axis", ["body", "vertical"])
@pytest.mark.parametrize("kind", [Altimeter, MultibeamProfile])
def test_the_equation_predicts_the_reading_and_its_derivatives(kind: Any, axis: str) -> None:
    bottom = hills()
    table = {"axis": axis, "lever_arm_m": [1.5, -0.5, 0.4], "sound_speed_percent": 0.3, "chart_error_m": 0.5, **QUIET}
    sounder = device(Bottom(bottom), 3, kind, **table)
    # A beam with gimbals turns with the heading, which is that of the body for small angles only.
    tap = taps(1, (31.0, -47.0, 40.0), (0.08, -0.05, 0.8) if axis == "body" else (0.0, 0.0, 0.8))
    stream, last = sounder.sense(tap), sounder.channels[-1]
    sheet = kind.from_toml(table).datasheet("sounder")
    sheet.details["bottom"] = bottom.chart()
    blocks = {"sound_speed": sounder.block("sound_speed", tap.time)[0], "chart": np.zeros(len(sheet.channels))}
    dcm, row = dcm_from_rpy(tap.attitude)[0], np.zeros(3)
    point = NavigationPoint(0.0, tap.position[0], row, dcm, row, blocks, last, np.ones(1))

    def at(offset: Any = row, turn: Any = row, **more: Any) -> tuple[Array, dict[str, Array]]:
        changed = {name: value + more.get(name, 0.0) for name, value in blocks.items()}
        turned = dcm_from_rotation_vector(np.asarray(turn)) @ dcm
        place = displace(point.position, np.asarray(offset))
        return observe(point._replace(position=place, dcm=turned, blocks=changed), sheet)

    reading, jacobian = at()
    assert stream.value[-1] == pytest.approx(reading, abs=2e-3)
    for k, e in enumerate(np.eye(3)):
        step = (at(offset=0.05 * e)[0] - at(offset=-0.05 * e)[0]) / 0.1
        np.testing.assert_allclose(step, jacobian[NAVIGATION][:, k], atol=2e-3)
        turn = (at(turn=1e-3 * e)[0] - at(turn=-1e-3 * e)[0]) / 2e-3
        np.testing.assert_allclose(turn, jacobian[NAVIGATION][:, 6 + k], atol=0.1)  # of 50 m
    of_the_beam = np.arange(len(sheet.channels)) == sheet.channels.index(last)
    for name, step, column in (("sound_speed", 1e-4, 0), ("chart", 1e-2, -1)):
        np.testing.assert_allclose((at(**{name: step})[0] - reading) / step, jacobian[name][:, column], rtol=1e-6)
    assert np.array_equal(jacobian["chart"][0] != 0.0, of_the_beam)
    # An error of the chart is a bottom that is deeper by it.
    deeper = DepthGrid(bottom.middle, bottom.spacing, bottom.depth + 0.05)
    sheet.details["bottom"] = deeper.chart()
    assert at()[0] - reading == pytest.approx(0.05 * jacobian["chart"][0, -1:], rel=0.03)


def test_noise_grows_with_the_range_and_is_stated() -> None:
    for depth, sigma in ((50.0, np.hypot(0.05, 0.03)), (140.0, np.hypot(0.05, 0.3))):
        sounder = device(FlatBottom(depth), sigma_m=0.05, range_noise_percent=0.3, maximum_range_m=200.0)
        stream = sounder.sense(taps(4000))
        error = stream.value[:, 0] - (depth - 40.0)
        assert error.std() == pytest.approx(sigma, rel=0.04)
        np.testing.assert_allclose(stream.sigma, sigma, rtol=0.01)
        assert abs(error.mean()) < 4.0 * sigma / np.sqrt(4000)


def test_readings_are_lost_and_false_as_often_as_told_and_labelled() -> None:
    sounder = device(FlatBottom(90.0), lost=0.2, false_readings=0.1)
    stream = sounder.sense(taps(4000))
    assert len(stream.dropped) / 4000 == pytest.approx(0.2, abs=0.02)
    wrong = stream.faults != 0
    assert wrong.mean() == pytest.approx(0.1, abs=0.02)
    np.testing.assert_allclose((stream.value - stream.fault_error)[:, 0], 50.0, atol=0.5)
    assert (stream.fault_error[wrong] < -4.0).all()
    assert not stream.fault_error[~wrong].any()


def test_no_reading_beyond_the_range_without_a_bottom_or_off_the_grid() -> None:
    assert not len(device(FlatBottom(90.0), maximum_range_m=49.0).sense(taps(3)).time)
    assert not len(device(FlatBottom(41.0), minimum_range_m=2.0).sense(taps(3)).time)
    assert not len(device(FlatBottom(40.2)).sense(taps(3)).time)
    alone = Altimeter.from_toml({}).install("sounder", 1, Surroundings())
    assert not len(alone.sense(taps(3)).time)
    edge = device(Bottom(slope()), spec=MultibeamProfile, beams=3, swath_deg=90.0).sense(taps(1, (0.0, 380.0, 40.0)))
    assert set(edge.channel) == {0, 1}  # the beam to starboard meets what is not on the grid


def test_a_ping_waits_for_the_echo_of_the_one_before() -> None:
    stream = device(FlatBottom(1400.0), maximum_range_m=2000.0, rate_hz=1.0).sense(taps(10))
    np.testing.assert_allclose(stream.time, [0.0, 2.0, 4.0, 6.0, 8.0])


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"minimum_range_m": 100.0}, "minimum_range_m = 100: should be below maximum_range_m = 100"),
        ({"fixed_sound_speed_percent": 30.0}, "an error of some percent"),
        ({"beam_width_deg": 90.0}, "beam_width_deg"),
        ({"axis": "up"}, "axis"),
    ],
)
def test_bad_figures_are_refused(table: dict[str, Any], words: str) -> None:
    with pytest.raises(SpecError, match=words):
        Altimeter.from_toml(table)


def test_a_vehicle_in_the_ground_or_off_the_grid_is_told() -> None:
    with pytest.raises(InstrumentError, match=r"at 0 s it is 10\.0 m below the bottom; the voyage should be above it"):
        device(FlatBottom(30.0)).sense(taps(2))
    with pytest.raises(InstrumentError, match="is outside of the grid of depths, which spans"):
        device(Bottom(slope())).sense(taps(2, (500.0, 0.0, 40.0)))


class _Otherwise:
    def depth(self, position: Array, time: Array) -> Array:
        return np.full(len(time), 90.0)


def test_a_bottom_without_a_grid_is_refused() -> None:
    with pytest.raises(InstrumentError, match=r"it needs water_depth_m or \[surroundings.bathymetry\]"):
        device(_Otherwise()).sense(taps(2))


def test_estimators_receive_the_chart() -> None:
    table: dict[str, Any] = {
        "name": "charted", "version": 1, "title": "x", "duration_s": 10,
        "start": PLACE | {"depth_m": 40.0, "speed_m_s": 1.5}, "vessel": {"kind": "uuv"},
        "surroundings": {"bathymetry": PLACE | {"extent_m": [400, 400], "roughness_m": 2.0}},
        "instruments": {"altimeter": {"rate_hz": 1.0}, "imu": {"rate_hz": 20.0, "grade": "tactical"}},
    }  # fmt: skip
    scenario = Scenario.from_toml(table)
    recording = record(scenario, 5)
    sheet = recording.instruments["altimeter"]
    assert sheet.details["bottom"]["depth"].shape == (41, 41)
    grid, truth = grid_of(sheet.details["bottom"]), recording.data.truth
    dcm, none = dcm_from_rpy(truth.attitude), np.zeros(len(truth.time))
    found = soundings(grid, truth.position, dcm, np.zeros(3), none, "body", 0.0)
    stream = recording.data.aids["altimeter"]
    assert len(stream.time) >= 10
    np.testing.assert_allclose(stream.value[:, 0], np.interp(stream.time, truth.time, found.distance), atol=0.5)
    del table["surroundings"]
    table["water_depth_m"] = 70.0
    assert Scenario.from_toml(table).instruments_sheet()["altimeter"].details["bottom"]["depth"].tolist() == [[70.0]]
