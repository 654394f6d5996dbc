"""The four beams of a Doppler velocity log and what is solved from them, against closed forms and published figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from simnav.blocks import NAVIGATION
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy
from simnav.kinds import NavigationPoint
from simnav.recording import AidStream
from simnav.sensors import DvlBeams, DvlSolution, DvlWaterSolution
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.derived import DerivedInstrument
from simnav.sensors.dvl_beams import CLASSES, observe
from simnav.sensors.dvl_solution import BeamSolution, solutions
from simnav.sensors.dvl_water_solution import observe as through_water
from simnav.sensors.errors import InstrumentError
from simnav.sensors.janus import absorption, beam_axes, noise_by_range, solve_beams
from simnav.spec import SpecError
from simnav.types import Array, TapStates
from simnav.world.current import Current, WaterFlow
from simnav.world.surroundings import FlatBottom, Surroundings

SQUARE = np.radians([45.0, 135.0, 225.0, 315.0])
START = np.array([np.radians(54.0), np.radians(8.0), -40.0])
QUIET: dict[str, Any] = {"fading": 0.0, "bias_m_s": 0.0, "sound_speed_percent": 0.0}


Triple = tuple[float, float, float]
_ZERO = (0.0, 0.0, 0.0)


def taps(
    n: int, velocity: Triple = (2.0, 0.0, 0.0), attitude: Triple = _ZERO, *, rate: float = 5.0, height: float = -40.0
) -> TapStates:
    """A vessel that keeps its velocity, attitude and depth."""

    def rows(vector: Any) -> Array:
        return np.broadcast_to(np.asarray(vector, dtype=float), (n, 3)).copy()

    position = rows([*START[:2], 0.0])
    position[:, 2] = height
    zero = np.zeros((n, 3))
    return TapStates(np.arange(1, n + 1) / rate, position, rows(velocity), rows(attitude), zero, zero.copy())


def device(
    table: Mapping[str, Any] | None = None, depth: float | None = 100.0, seed: int = 1, **parts: Any
) -> ChannelInstrument:
    """The beams of one run over a flat bottom."""
    spec = DvlBeams.from_toml(QUIET | {"rate_hz": 5.0} | dict(table or {}))
    bottom = {} if depth is None else {"bottom": FlatBottom(depth)}
    made = spec.install("dvl", seed, Surroundings(bottom | parts))
    assert isinstance(made, ChannelInstrument)
    return made


def slant_of(dvl: ChannelInstrument) -> float:
    """Angle of the beams [rad]."""
    spec = vars(dvl)["spec"]
    assert isinstance(spec, DvlBeams)
    return spec.slant


def solved(
    stream: AidStream, dvl: ChannelInstrument, time: Array, kind: type[BeamSolution] = DvlSolution, **more: Any
) -> AidStream:
    """What the second instrument of the device makes of a stream."""
    spec = kind.from_toml({"sigma_m_s": 0.003, "beams": "dvl", "rate_hz": 5.0} | more)
    made = spec.build("solved", 1)
    assert isinstance(made, DerivedInstrument)
    return made.derived(time, {"dvl": stream}, {"dvl": dvl.sheet})


def by_ping(stream: AidStream) -> Array:
    """(n, 4) readings of a stream in which none is missing."""
    return stream.value.reshape(-1, 4)


def solver(slant: float) -> Array:
    """(3, 4) what a solution makes of the readings of the beams."""
    return solve_beams(np.eye(4), SQUARE, np.full(4, slant), np.ones((4, 4))).velocity.T


@pytest.mark.parametrize("frequency", CLASSES)
def test_the_covariance_of_solved_velocities_is_that_of_the_geometry(frequency: float) -> None:
    # Level, flat: sigma^2 / (2 sin^2) for the level components, sigma^2 / (4 cos^2) for the vertical one.
    dvl = device({"frequency_khz": frequency}, depth=60.0)
    stream = dvl.sense(taps(40000))
    slant, sigma = slant_of(dvl), stream.sigma[0, 0]
    found = np.cov(solver(slant) @ by_ping(stream).T)
    level, vertical = sigma**2 / (2.0 * np.sin(slant) ** 2), sigma**2 / (4.0 * np.cos(slant) ** 2)
    np.testing.assert_allclose(np.diag(found), [level, level, vertical], rtol=0.03)
    assert abs(found - np.diag(np.diag(found))).max() < 0.03 * level
    one = solve_beams(by_ping(stream)[:1], SQUARE, np.full(4, slant), np.full((1, 4), sigma))
    np.testing.assert_allclose(one.covariance[0], np.diag([level, level, vertical]), atol=1e-12)
    assert one.figure_of_merit == pytest.approx(np.sqrt(2.0 * level))


def test_the_bias_of_many_pings_is_that_of_the_datasheet() -> None:
    dvl = device({"bias_m_s": 0.001, "sound_speed_percent": 0.2}, depth=60.0, seed=3)
    wrong = solver(slant_of(dvl)) @ by_ping(dvl.sense(taps(100_000))).mean(axis=0) - [2.0, 0.0, 0.0]
    scale = dvl.block("sound_speed", np.zeros(1))[0, 0]
    expected = solver(slant_of(dvl)) @ dvl.bias[:, 0] + [2.0 * scale, 0.0, 0.0]
    assert abs(wrong - expected).max() < 5.0 * 0.004 / np.sqrt(100_000)
    assert np.linalg.norm(wrong) < 3.0 * np.hypot(0.002 * 2.0, 0.001)
    long_term = []
    for seed in range(60):
        one = device({"bias_m_s": 0.001, "sound_speed_percent": 0.2}, seed=seed)
        long_term.append(
            (solver(slant_of(one)) @ one.bias[:, 0])[0] + 2.0 * one.block("sound_speed", np.zeros(1))[0, 0]
        )
    assert np.std(long_term) == pytest.approx(np.hypot(0.004, 0.001 * np.sqrt(2.0)), rel=0.25)


def test_a_phased_array_is_wrong_downwards_only() -> None:
    # Pathfinder DVL guide, April 2018: assumed 1500 m/s, true 1450 m/s, steered at 1536 m/s: true / output = 0.9569.
    slant = np.arcsin(1500.0 / (2.0 * 1536.0))
    table = {"array": "phased", "slant_deg": float(np.degrees(slant)), "sigma_m_s": 0.0, "speed_noise_percent": 0.0}
    dvl = device(table | {"fixed_sound_speed_percent": 100.0 * (1500.0 / 1450.0 - 1.0)})
    found = solver(slant) @ by_ping(dvl.sense(taps(1, (1.5, -0.4, 0.3))))[0]
    np.testing.assert_allclose(found[:2], [1.5, -0.4], atol=1e-12)
    assert 0.3 / found[2] == pytest.approx(0.9569, abs=5e-5)


@pytest.mark.parametrize("array", ["piston", "phased"])
@pytest.mark.parametrize("track", ["bottom", "water"])
def test_the_equation_predicts_the_reading_and_its_derivatives(array: str, track: str) -> None:
    table = {
        "array": array, "track": track, "mounting_deg": 1.0, "sound_speed_percent": 1.0,
        "lever_arm_m": [1.0, -0.5, 0.4], "sigma_m_s": 0.0, "speed_noise_percent": 0.0,
    }  # fmt: skip
    flow = WaterFlow(Current(speed=0.5, direction=0.7), 1, np.array([*START[:2], 0.0]))
    dvl = device(table, current=flow)
    tap = taps(1, (1.5, 0.6, -0.2), (0.1, -0.05, 0.8))
    tap = replace(tap, angular_rate=np.array([[0.02, -0.01, 0.05]]))
    stream = dvl.sense(tap)
    assert len(stream) == 4
    blocks = {b.name: dvl.block(b.name, tap.time)[0] for b in dvl.sheet.blocks}
    if track == "water":
        blocks["current"] = flow.velocity(tap.position, tap.time)[0, :2]
    point = NavigationPoint(
        1.0, tap.position[0], tap.velocity[0], dcm_from_rpy(tap.attitude)[0], tap.angular_rate[0], blocks
    )

    def at(row: int, velocity: Any = _ZERO, turn: Any = _ZERO, **more: Any) -> tuple[Array, dict[str, Array]]:
        changed = {name: value + more.get(name, 0.0) for name, value in blocks.items()}
        turned = dcm_from_rotation_vector(np.array(turn)) @ point.dcm
        moved = point.velocity + velocity
        return observe(point._replace(velocity=moved, dcm=turned, blocks=changed, side=stream.side[row]), dvl.sheet)

    for row in range(4):
        reading, jacobian = at(row)
        np.testing.assert_allclose(reading, stream.value[row], atol=1e-12)
        h = 1e-6
        for k, e in enumerate(h * np.eye(3)):
            # Errors are estimate minus truth: the reading at the truth less than that at the estimate.
            assert (at(row, velocity=e)[0] - reading)[0] / h == pytest.approx(jacobian[NAVIGATION][0, 3 + k], abs=1e-5)
            assert (at(row, turn=e)[0] - reading)[0] / h == pytest.approx(jacobian[NAVIGATION][0, 6 + k], abs=1e-5)
        for name, value in blocks.items():
            for k, e in enumerate(h * np.eye(len(value))):
                slope = (at(row, **{name: e})[0] - reading)[0] / h
                assert slope == pytest.approx(jacobian[name][0, k], abs=0.03)  # mounting: to first order


@pytest.mark.parametrize("array", ["piston", "phased"])
def test_the_equation_of_a_solved_water_track(array: str) -> None:
    table = {"mounting_deg": 1.0, "sound_speed_percent": 1.0, "lever_arm_m": [1.0, -0.5, 0.4], "array": array}
    flow = WaterFlow(Current(speed=0.5, direction=0.7), 1, np.array([*START[:2], 0.0]))
    noise = {"sigma_m_s": 0.0, "speed_noise_percent": 0.0, "track": "water"}
    dvl = device(table | noise, current=flow)
    tap = taps(1, (1.5, 0.6, -0.2), (0.1, -0.05, 0.8))
    tap = replace(tap, angular_rate=np.array([[0.02, -0.01, 0.05]]))
    sheet = DvlWaterSolution.from_toml({"sigma_m_s": 0.01} | table).datasheet("velocity")
    blocks = {b.name: dvl.block(b.name, tap.time)[0] for b in dvl.sheet.blocks}
    blocks["current"] = flow.velocity(tap.position, tap.time)[0, :2]
    point = NavigationPoint(
        1.0, tap.position[0], tap.velocity[0], dcm_from_rpy(tap.attitude)[0], tap.angular_rate[0], blocks
    )
    reading, jacobian = through_water(point, sheet)
    found = solved(dvl.sense(tap), dvl, tap.time, DvlWaterSolution, error_velocity_m_s=1.0)
    np.testing.assert_allclose(reading, found.value[0], atol=1e-12)
    assert {b.name for b in sheet.blocks} == set(blocks) == set(jacobian) - {NAVIGATION}
    for k, e in enumerate(1e-6 * np.eye(3)):
        turned = dcm_from_rotation_vector(e) @ point.dcm
        moves = point._replace(velocity=point.velocity + e), point._replace(dcm=turned)
        for first, moved in zip((3, 6), moves, strict=True):
            slope = (through_water(moved, sheet)[0] - reading) / 1e-6
            np.testing.assert_allclose(slope, jacobian[NAVIGATION][:, first + k], atol=1e-5)
    for name, value in blocks.items():
        for k, e in enumerate(1e-6 * np.eye(len(value))):
            moved = point._replace(blocks=blocks | {name: value + e})
            slope = (through_water(moved, sheet)[0] - reading) / 1e-6
            np.testing.assert_allclose(slope, jacobian[name][:, k], atol=0.03)  # mounting: to first order


def test_the_division_into_blocks_changes_nothing() -> None:
    table = {"fading": 3.0, "false_beams": 0.1, "maximum_altitude_m": 62.0, "aeration": 1.0, "search_s": 1.0}
    whole = device(table).sense(taps(300))
    dvl, tap, parts = device(table), taps(300), []
    for rows in (slice(0, 7), slice(7, 8), slice(8, 300)):
        parts.append(dvl.sense(TapStates(*(getattr(tap, f)[rows] for f in tap.__dataclass_fields__))))
    assert 0 < len(whole) < 1200
    np.testing.assert_array_equal(np.concatenate([p.value for p in parts]), whole.value)
    np.testing.assert_array_equal(np.concatenate([p.faults for p in parts]), whole.faults)


def test_pings_take_the_time_of_their_echoes() -> None:
    # 180 m: a slant range of 208 m, 2 x 208 / 1500 + 0.03 = 0.307 s, so every third sample of 7 Hz.
    tap = taps(70, rate=7.0, height=0.0)
    slow = device({"frequency_khz": 500, "slant_deg": 30.0, "rate_hz": 7.0}, depth=180.0).sense(tap)
    near = device({"frequency_khz": 500, "slant_deg": 30.0, "rate_hz": 7.0}, depth=20.0).sense(tap)
    assert np.diff(np.unique(slow.time)) == pytest.approx(3.0 / 7.0)
    assert len(near) == 4 * 70


def test_the_bottom_is_lost_and_regained() -> None:
    tap = taps(300, height=0.0)
    tap.position[100:200, 2] = 50.0  # 110 m above the bottom, beyond the reach of 90 m
    stream = device(depth=60.0).sense(tap)
    heard = np.unique(stream.time)
    assert heard[heard < 30.0][-1] == pytest.approx(20.0)
    assert 40.2 + 2.0 <= heard[heard > 30.0][0] < 40.2 + 2.6
    # One ping without an echo is no loss of the lock.
    tap.position[100:200, 2] = 0.0
    tap.position[150, 2] = 50.0
    assert len(np.unique(device(depth=60.0).sense(tap).time)) == 299


def test_a_weak_echo_is_noisy_and_then_lost() -> None:
    near, far = (device({"fading": 2.0}, depth=d).sense(taps(2000, height=0.0, rate=1.0)) for d in (45.0, 89.0))
    assert len(near) == 8000
    assert 0.5 * 8000 < len(far) < 0.8 * 8000
    assert far.sigma.mean() > 1.8 * near.sigma.mean()
    soft = device({"bottom_loss": 20.0}, depth=89.0).sense(taps(50, height=0.0))
    assert len(soft) == 0
    assert noise_by_range(np.array([0.0, 60.0])) == pytest.approx([np.sqrt(5.0), 1.0], rel=1e-5)


def francois_garrison(f: float, t: float) -> float:
    """Absorption [dB/m] at the surface, 35 ppt and pH 8 (Journal of the Acoustical Society of America 72, 1982)."""
    c, kelvin = 1412.0 + 3.21 * t + 1.19 * 35.0, 273.0 + t
    f1, f2 = 2.8 * 10.0 ** (4.0 - 1245.0 / kelvin), 8.17 * 10.0 ** (8.0 - 1990.0 / kelvin)
    boric, magnesium = 8.86 / c * 10.0 ** (0.78 * 8.0 - 5.0), 21.44 * 35.0 / c * (1.0 + 0.025 * t)
    water = 4.937e-4 - 2.59e-5 * t + 9.11e-7 * t**2 - 1.5e-8 * t**3
    return float(1e-3 * f**2 * (boric * f1 / (f1**2 + f**2) + magnesium * f2 / (f2**2 + f**2) + water))


@pytest.mark.parametrize("frequency", CLASSES)
def test_absorption_agrees_with_the_formula_of_francois_and_garrison(frequency: float) -> None:
    for temperature in (2.0, 10.0, 18.0):
        expected = francois_garrison(frequency, temperature)
        assert absorption(frequency, temperature) == pytest.approx(expected, rel=0.1)


class Slope:
    """A bottom that falls to the north by 0.2."""

    def depth(self, position: Array, time: Array) -> Array:
        found: Array = 100.0 + 0.2 * (position[:, 0] - START[0]) * 6.3825e6
        return found


def test_ranges_are_those_of_a_slope() -> None:
    dvl = device(depth=None, bottom=Slope())
    axes = beam_axes(SQUARE, slant_of(dvl))
    expected = 60.0 / (axes[:, 2] - 0.2 * axes[:, 0])
    found = dvl.sense(taps(400)).side[:, 2].reshape(-1, 4).mean(axis=0)
    np.testing.assert_allclose(found, expected, rtol=5e-3)


def test_false_beams_have_labels_and_spoil_what_is_solved() -> None:
    dvl = device({"false_beams": 0.02}, depth=60.0)
    dvl.bit = 2
    stream = dvl.sense(taps(3000))
    false = stream.faults == 4
    assert 0.012 < false.mean() < 0.028
    clean = device(depth=60.0).sense(taps(3000))
    np.testing.assert_allclose(stream.value - stream.fault_error, clean.value, atol=1e-9)
    time = taps(3000).time
    checked = solved(stream, dvl, time)
    touched = np.unique(stream.time[false])
    # In still water one false beam is wrong by N(0, 0.2 m/s), and the error velocity by 1 / (2 sqrt(2) sin 30) of that.
    found = 2.0 * norm.sf(0.1 * np.sqrt(2.0) / 0.2)
    assert np.isin(touched, checked.dropped).mean() == pytest.approx(found, abs=0.1)
    assert np.isin(checked.dropped, touched).all()
    unchecked = solved(stream, dvl, time, error_velocity_m_s=1e9)
    assert len(unchecked) == 3000
    assert (unchecked.faults != 0).sum() == len(touched)
    right = unchecked.value - unchecked.fault_error
    np.testing.assert_allclose(right.mean(axis=0), [2.0, 0.0, 0.0], atol=5e-4)


@pytest.mark.parametrize(("lost", "beams"), [([1], 3), ([1, 2], 2)])
def test_three_beams_are_enough_and_two_are_not(lost: list[int], beams: int) -> None:
    dvl, time = device(depth=60.0), taps(2).time
    stream = dvl.sense(taps(2))
    there = ~np.isin(stream.channel, lost)
    part = replace(
        stream, time=stream.time[there], value=stream.value[there], faults=stream.faults[there],
        fault_error=stream.fault_error[there], sigma=stream.sigma[there], channel=stream.channel[there],
        side=stream.side[there],
    )  # fmt: skip
    times, found = solutions(part)
    np.testing.assert_array_equal(times, time)
    assert found.beams.tolist() == [beams] * 2
    assert np.isnan(found.error_velocity).all()
    assert np.isfinite(found.figure_of_merit).all() == (beams == 3)
    answer = solved(part, dvl, time)
    assert len(answer) == (2 if beams == 3 else 0)
    np.testing.assert_allclose(answer.value, np.tile([2.0, 0.0, 0.0], (len(answer), 1)), atol=0.03)
    assert len(solved(part, dvl, time, three_beams=False)) == 0
    assert len(solved(part, dvl, time, three_beams=False).dropped) == 2


def test_water_track_is_relative_to_the_layer_and_needs_one() -> None:
    flow = WaterFlow(Current(speed=0.5, direction=0.0, shear=0.01), 1, np.array([*START[:2], 0.0]))
    water = device({"track": "water", "sigma_m_s": 0.0, "speed_noise_percent": 0.0}, depth=80.0, current=flow)
    stream = water.sense(taps(3, height=0.0))
    # The layer is 16 to 64 m deep; at 40 m the current is 0.5 - 0.4 m/s.
    np.testing.assert_allclose((solver(slant_of(water)) @ by_ping(stream).T)[0], 1.9, atol=1e-3)
    velocity = solved(stream, water, taps(3).time, DvlWaterSolution)
    np.testing.assert_allclose(velocity.value, np.tile([1.9, 0.0, 0.0], (3, 1)), atol=1e-3)
    assert len(device({"track": "water"}, depth=3.0).sense(taps(3, height=0.0))) == 0
    assert len(device({"track": "water"}, depth=4000.0).sense(taps(3, height=0.0))) == 12
    with pytest.raises(InstrumentError, match="'solved' of kind 'dvl_solution': it needs beams with track = 'bottom'"):
        solved(stream, water, taps(3).time)
    bottom = device({}, depth=80.0)
    with pytest.raises(InstrumentError, match="of kind 'dvl_water_solution': it needs beams with track = 'water'"):
        solved(bottom.sense(taps(3)), bottom, taps(3).time, DvlWaterSolution)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"frequency_khz": 300, "sigma_m_s": 0.004},
            "frequency_khz = 300: figures are known at 500, 600, 1000 kHz; at another frequency give slant_deg, ",
        ),
        ({"frequency_khz": "high"}, "frequency_khz = 'high' should be a number"),
        ({"slant_deg": 95.0}, "slant_deg"),
        ({"minimum_altitude_m": 100.0}, "minimum_altitude_m = 100: should be below maximum_altitude_m = 90"),
        ({"false_beams": 1.5}, "false_beams"),
        (
            {"fixed_sound_speed_percent": -100.0},
            "fixed_sound_speed_percent = -100: the assumed speed of sound is so low",
        ),
        ({"track": "surface"}, "track"),
    ],
)
def test_bad_input_gets_a_sentence(table: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        DvlBeams.from_toml(table)
