"""Allan deviations: against allantools and theory, for each error process and each IMU by name over 6 h."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.leaderboard.allan import markov_variance
from simnav.sensors.allan import AllanCurve, allan_deviation, imu_allan
from simnav.sensors.imu import ImuSpec
from simnav.sensors.imu_models import IMU_MODELS
from simnav.types import ImuSamples

RATE, HOURS = 2.0, 6.0
#: One process each, in the units of the keys.
PROCESSES = {
    "white noise": {"random_walk_deg_sqrt_h": 0.15},
    "in-run bias": {"bias_instability_deg_h": 0.5, "correlation_time_s": 200.0},
    "bias as a random walk": {"bias_instability_deg_h": 0.01, "correlation_time_s": float("inf")},
    "rate random walk": {"rate_random_walk_deg_h_sqrt_h": 2.0},
    "quantization": {"quantization_arcsec": 0.5, "random_walk_deg_sqrt_h": 0.02},
}


def at_rest(spec: ImuSpec, seed: int = 3) -> ImuSamples:
    n = round(HOURS * 3600.0 * spec.rate)
    time = np.arange(1, n + 1) / spec.rate
    still = ImuSamples(time, np.full(n, 1.0 / spec.rate), np.zeros((n, 3)), np.tile([0.0, 0.0, -9.8], (n, 1)))
    return spec.build(seed).sense(still)


def compare(values, numbers):
    """Our deviation, after a comparison with that of allantools at the same averaging times."""
    allantools = pytest.importorskip("allantools")
    time, deviation = allan_deviation(values, RATE, numbers)
    found, theirs, _, _ = allantools.oadev(values[:, 0], rate=RATE, data_type="freq", taus=time)
    np.testing.assert_allclose(found, time)
    np.testing.assert_allclose(deviation[:, 0], theirs, rtol=1e-6)
    return time, deviation


@pytest.mark.parametrize("name", PROCESSES)
def test_a_process_has_its_allan_deviation(name):
    """Over the three axes; the tolerance grows as the number of independent averages gets smaller."""
    spec = ImuSpec.from_toml({"rate_hz": RATE, "gyroscope": PROCESSES[name]})
    time, deviation = compare(at_rest(spec).angular_rate, np.array([1, 2, 6, 20, 200, 600]))
    expected = np.sqrt(markov_variance(spec.gyroscope.datasheet(), time))
    found = np.sqrt(np.mean(deviation**2, axis=1))
    tolerance = 0.02 + 3.0 * np.sqrt(0.5 / (3.0 * (HOURS * 3600.0 / time - 1.0)))
    held = time >= (3.0 if "bias" in name or "rate" in name else 0.0)  # biases change once a second at most
    assert held.sum() >= 3
    assert (np.abs(found / expected - 1.0) < tolerance)[held].all()


@pytest.mark.parametrize("name", IMU_MODELS)
def test_an_imu_by_name_has_the_allan_deviation_of_its_datasheet(name):
    spec = ImuSpec.from_toml({"rate_hz": RATE, "model": name})
    samples = at_rest(spec)
    for values, triad in ((samples.angular_rate, spec.gyroscope), (samples.specific_force, spec.accelerometer)):
        if not triad.random_walk:  # the HG9900 states no noise of its accelerometers
            np.testing.assert_allclose(allan_deviation(values, RATE)[1], 0.0, atol=1e-12)
            continue
        time, deviation = compare(values, np.array([2, 20, 200, 1134]))
        found = np.sqrt(np.mean(deviation**2, axis=1))
        expected = np.sqrt(markov_variance(triad.datasheet(), time))
        tolerance = 0.02 + 3.0 * np.sqrt(0.5 / (3.0 * (HOURS * 3600.0 / time - 1.0)))
        assert (np.abs(found / expected - 1.0) < tolerance).all()
    figures = IMU_MODELS[name]
    if "random_walk_deg_sqrt_h" in figures.gyroscope:
        white = 60.0 * np.degrees(np.sqrt(np.mean(allan_deviation(samples.angular_rate, RATE, np.array([2]))[1] ** 2)))
        assert white == pytest.approx(figures.gyroscope["random_walk_deg_sqrt_h"], rel=0.1)


def test_the_in_run_bias_peaks_at_the_level_of_the_datasheet():
    spec = ImuSpec.from_toml({"rate_hz": 1.0, "model": "STIM300"}).gyroscope
    time = np.geomspace(1.0, 1e4, 400)
    sheet = spec.datasheet()
    in_run = markov_variance(type(sheet)(bias_instability=sheet.bias_instability, correlation_time=300.0), time)
    assert 3600.0 * np.degrees(np.sqrt(in_run.max())) == pytest.approx(0.5, rel=1e-3)
    assert time[np.argmax(in_run)] == pytest.approx(1.89 * 300.0, rel=0.02)
    short = markov_variance(type(sheet)(bias_instability=1.0, correlation_time=1e5), np.array([99.0, 101.0]))
    assert short == pytest.approx(2.0 * np.array([99.0, 101.0]) / 3.0 / 1e5, rel=2e-3)


def test_coefficients_are_found_again():
    time = np.geomspace(0.01, 1e4, 61)
    n, b, k, q = 3e-5, 2e-6, 4e-8, 1e-7
    variance = n**2 / time + (0.664 * b) ** 2 + k**2 * time / 3.0 + 3.0 * q**2 / time**2
    (found, *_) = AllanCurve(time, np.sqrt(variance)[:, None].repeat(6, axis=1)).coefficients()
    np.testing.assert_allclose(
        [found.random_walk, found.bias_instability, found.rate_random_walk, found.quantization], [n, b, k, q], rtol=1e-4
    )
    assert found.lowest == pytest.approx(np.sqrt(variance.min()))
    nothing = AllanCurve(time, np.zeros((61, 6))).coefficients()[0]
    assert (nothing.random_walk, nothing.lowest) == (0.0, 0.0)


def test_what_cannot_be_averaged_is_refused():
    with pytest.raises(ValueError, match="needs at least 2 samples, not 1"):
        allan_deviation(np.zeros((1, 3)), 1.0)
    with pytest.raises(ValueError, match="averages are over 1 to 10 of 20 samples, not over 1 to 11"):
        allan_deviation(np.zeros((20, 3)), 1.0, np.array([1, 11]))
    samples = at_rest(ImuSpec(rate=0.1))
    assert imu_allan(samples, 0.1).deviation.shape[1] == 6
