"""Coarse alignment: levelling in closed form, gyrocompassing against its bound, and that nothing of the run is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.coarse_alignment import ENOUGH, LEVELLING, WIDER, CoarseAlignment, turn
from simnav.geometry.earth import gravity
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, wrap_angle
from simnav.recording import Recording
from simnav.scenario import load
from simnav.scenario.catalogue import headers
from simnav.scenario.reading import parse
from simnav.source import record
from simnav.types import ImuSamples, Measurements, NavigationStates

DEG = np.pi / 180.0
NOT_LEVEL, NO_HEADING = (180.0, 180.0, 180.0), (0.1, 0.1, 180.0)


def begin(recording: Recording, sigma_deg: tuple[float, float, float], off_deg: float = 130.0) -> Recording:
    """The recording with a start whose attitude is worth nothing, where its sigma says so."""
    covariance, attitude = recording.start.covariance.copy(), recording.initial_truth.attitude[0].copy()
    covariance[6:] = covariance[:, 6:] = 0.0
    covariance[range(6, 9), range(6, 9)] = (np.array(sigma_deg) * DEG) ** 2
    attitude += np.where(np.array(sigma_deg) == 180.0, off_deg, 0.0) * DEG * np.array([1.0, 0.3, 1.0])
    return replace(recording, start=replace(recording.start, attitude=attitude, covariance=covariance))


@pytest.fixture(scope="module")
def voyage(recording_of) -> Recording:
    return recording_of(5, 60.0)


@pytest.mark.parametrize(
    ("sigma_deg", "unknown"), [((0.1, 0.1, 100.0), ""), (NO_HEADING, "heading"), (NOT_LEVEL, "attitude")]
)
def test_a_start_says_what_it_does_not_know(voyage: Recording, sigma_deg: tuple[float, float, float], unknown: str):
    assert begin(voyage, sigma_deg).start.unknown == unknown


@pytest.mark.parametrize("written", ["[180.0, 1.0, 1.0]", "[1.0, 180.0, 180.0]"])
def test_roll_or_pitch_alone_cannot_be_unknown(written: str):
    (path,) = (h.path for h in headers() if h.name == "moored-alignment")
    with pytest.raises(ValueError, match=r"attitude_deg.*nothing of the attitude is known: \[180, 180, 180\]"):
        parse(path.read_text().replace("[180.0, 180.0, 180.0]", written))


def test_axes_turn_with_the_gyroscopes_and_the_force_is_that_of_the_beginning():
    """A constant rate: the rotation vector grows with time, and a force that is constant in the first axes sums up."""
    n, dt, rate, bias = 200, 0.01, np.array([0.3, -0.2, 0.5]), np.array([0.01, 0.02, -0.03])
    force = np.array([1.0, -2.0, -9.0])
    seen = np.array([dcm_from_rotation_vector(k * dt * rate).T @ force for k in range(n)])
    dcm, pushed = np.eye(3), np.zeros(3)
    turn(np.tile(rate + bias, (n, 1)), seen, np.full(n, dt), bias, dcm, pushed)
    np.testing.assert_allclose(dcm, dcm_from_rotation_vector(n * dt * rate), atol=1e-12)
    np.testing.assert_allclose(pushed, n * dt * force, rtol=1e-12)


@pytest.mark.parametrize("acceleration", [0.0, 1.5])
def test_roll_and_pitch_point_the_force_up(voyage: Recording, acceleration: float):
    """At rest exact; a steady acceleration tilts it by its share of gravity, and the sigma says so."""
    roll, pitch = 8.0 * DEG, -12.0 * DEG
    start = begin(voyage, NOT_LEVEL).start
    dcm = dcm_from_rpy(np.array([roll, pitch, 0.4]))
    g = float(gravity(start.position[0], start.position[2]))
    level = np.array([np.cos(0.4), np.sin(0.4), 0.0])  # ahead
    n = round(LEVELLING / 0.02)
    force = np.tile(dcm.T @ (acceleration * level - np.array([0.0, 0.0, g])), (n, 1))
    time = 0.02 * np.arange(1, n + 1)
    alignment = CoarseAlignment(start, voyage.instruments)
    samples = ImuSamples(time, np.full(n, 0.02), np.zeros((n, 3)), force)
    alignment.packets.append(Measurements(0.0, LEVELLING, samples, []))
    found = alignment._level(alignment._turned(np.zeros(3))[1])
    tilt = np.hypot(*(found.attitude[:2] - [roll, pitch]))
    if acceleration:
        assert tilt == pytest.approx(np.arctan(acceleration / g), rel=0.05)
        assert np.sqrt(found.covariance[6, 6]) == pytest.approx(acceleration / g, rel=0.05)
    else:
        assert tilt < 1e-9
        assert np.sqrt(found.covariance[6, 6]) == pytest.approx(1.0 * DEG, rel=0.01)


@pytest.mark.parametrize("sigma_deg", [NO_HEADING, NOT_LEVEL])
def test_a_row_begins_at_time_0_with_what_was_found(voyage: Recording, sigma_deg: tuple[float, float, float]):
    """From the alignment on it gives, bit for bit, what it gives from that start; before, the position is there."""
    recording = begin(voyage, sigma_deg)
    row = make("ekf")
    row.reset(recording.start, recording.instruments)
    alignment = row._alignment
    estimates = [row.update(packet) for packet in recording.steps()]
    first = next(k for k, estimate in enumerate(estimates) if "aligning" not in estimate.diagnostics)
    assert (first >= LEVELLING - 1.0) == (sigma_deg == NOT_LEVEL)
    assert first < 50
    assert all(np.isfinite(e.position).all() and np.isfinite(e.covariance).all() for e in estimates)

    start = alignment.start
    sigma = np.sqrt(start.covariance.diagonal()[6:])
    error = wrap_angle(start.attitude - recording.initial_truth.attitude[0])
    assert np.all(np.abs(error) < 3.0 * sigma)
    assert np.all(sigma <= WIDER * ENOUGH)
    if sigma_deg == NO_HEADING:  # roll and pitch stay as they were told
        np.testing.assert_array_equal(start.attitude[:2], recording.start.attitude[:2])
        assert sigma[0] == pytest.approx(0.1 * DEG)
    told = make("ekf")
    told.reset(start, recording.instruments)
    expected = [told.update(packet) for packet in recording.steps()]
    for estimate, other in zip(estimates[first:], expected[first:], strict=True):
        np.testing.assert_array_equal(estimate.position, other.position)
        np.testing.assert_array_equal(estimate.covariance, other.covariance)


def test_a_smoother_has_the_whole_run(voyage: Recording):
    recording = begin(voyage, NOT_LEVEL)
    row = make("ekf-rts")
    row.reset(recording.start, recording.instruments)
    smoothed: list[NavigationStates | None] = []
    for k, packet in enumerate(recording.steps()):
        row.update(packet)
        if k in (0, 59):
            smoothed.append(row.smooth())
    assert smoothed[0] is None
    assert smoothed[1] is not None
    np.testing.assert_allclose(smoothed[1].time, np.arange(1.0, 61.0))
    off = wrap_angle(smoothed[1].attitude[0] - recording.data.truth.attitude[0])
    assert np.abs(off).max() < 3.0 * DEG


@pytest.mark.parametrize("name", ["heading-bank", "oracle"])
def test_a_row_that_searches_and_one_that_knows_do_not_wait(voyage: Recording, name: str):
    recording = begin(voyage, NO_HEADING)
    row = make(name)
    row.reveal(recording)
    row.reset(recording.start, recording.instruments)
    assert row._alignment is None


def test_the_heading_of_a_moored_ship_follows_from_the_earth_rate():
    """Nothing but gravity, Earth rate and fixes of a ship that lies still: navigation grade tells the heading."""
    scenario = load("moored-alignment").with_values({"name": "lying", "draw.grade": 0.01, "duration_s": 120.0})
    recording = record(scenario, 3)
    row = make("ekf")
    row.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        estimate = row.update(packet)
    assert "aligning" not in estimate.diagnostics
    error = wrap_angle(estimate.attitude[2] - recording.data.truth.attitude[-1, 2])
    sigma = np.sqrt(estimate.covariance[8, 8])
    assert abs(error) < 4.0 * sigma
    assert sigma < 2.0 * DEG


def test_nothing_tells_the_heading_of_a_moored_ship_with_a_poor_imu():
    """The motion in waves tells a little beside good fixes, and where the antenna is; here there is neither."""
    values = {"name": "lying", "draw.grade": 10.0, "duration_s": 60.0, "sea.significant_height_m": 0.01}
    values["instruments.gnss.lever_arm_m"] = [0.0, 0.0, 0.0]
    scenario = load("moored-alignment").with_values(values)
    recording = record(scenario, 3)
    row = make("ekf")
    row.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        estimate = row.update(packet)
    assert estimate.diagnostics["aligning"] == 1.0
    assert np.sqrt(estimate.covariance[8, 8]) > 20.0 * DEG
