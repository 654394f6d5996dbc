"""The Student-t noise: against numerical integration, its limits, and what it does to a gross error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, stats

from simnav.estimator import make
from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.adaptations.student_t import StudentT, normalised_trace, student_weight
from simnav.types import Datasheet, Instruments, Measurement


def test_the_trace_is_that_of_the_inverse():
    rng = np.random.default_rng(1)
    for m in (1, 2, 3):
        root, other = rng.normal(size=(2, m, m))
        noise, spread, e = root @ root.T + np.eye(m), other @ other.T, rng.normal(size=m)
        expected = np.trace(np.linalg.inv(noise) @ (np.outer(e, e) + spread))
        assert normalised_trace(noise, e, spread) == pytest.approx(expected, rel=1e-12)
    assert normalised_trace(np.zeros((1, 1)), np.ones(1), np.eye(1)) == -1.0


@pytest.mark.parametrize("innovation", [0.5, 2.0, 6.0, 20.0])
@pytest.mark.parametrize("predicted", [0.2, 2.0])
def test_the_correction_is_near_the_posterior_mean(innovation: float, predicted: float):
    """Prior N(0, p), measurement of Student's t noise with unit scale: the mean by quadrature.

    Variational Bayes approximates; a tenth of the innovation is what it may be off where the posterior has two modes.
    """
    dof = 6.0

    def density(x):
        return stats.norm.pdf(x, 0.0, np.sqrt(predicted)) * stats.t.pdf(innovation - x, dof)

    sides = {"points": [0.0, innovation], "limit": 200}
    mass = integrate.quad(density, -15.0, 25.0, **sides)[0]
    mean = integrate.quad(lambda x: x * density(x), -15.0, 25.0, **sides)[0] / mass
    weight = student_weight(np.array([innovation]), np.array([[predicted]]), np.eye(1), dof, 50)
    ours = predicted / (predicted + 1.0 / weight) * innovation
    assert abs(ours - mean) < 0.1 * innovation
    gaussian = predicted / (predicted + 1.0) * innovation
    if innovation >= 6.0:
        assert abs(ours - mean) < 0.5 * abs(gaussian - mean)


def test_the_weight_is_the_fixed_point():
    dof, v, p = 5.0, 4.0, 0.3
    w = student_weight(np.array([v]), np.array([[p]]), np.eye(1), dof, 200)
    gain = p / (p + 1.0 / w)
    e, after = (1.0 - gain) * v, (1.0 - gain) * p
    assert w == pytest.approx((dof + 1.0) / (dof + e * e + after), rel=1e-9)


def test_with_infinitely_many_degrees_of_freedom_it_is_the_ekf(recording_of, run_over):
    recording = recording_of(4, 60.0)
    expected, P = run_over(make("ekf"), recording)
    errors, Q = run_over(make("student-t", dof=float("inf")), recording)
    np.testing.assert_allclose(errors, expected, atol=1e-8)
    np.testing.assert_allclose(Q, P, rtol=1e-7, atol=1e-14)


def test_a_gross_error_counts_for_little():
    adaptation = StudentT(dof=6.0)
    adaptation.reset(Instruments([Datasheet("gnss", "gnss_position", 1.0, np.ones(3))]))
    m = Measurement(1.0, "gnss", "gnss_position", np.zeros(3))
    weights = []
    for size in (0.0, 1.0, 3.0, 10.0, 100.0):
        noise = adaptation.adapt(Innovation(m, np.array([size, 0.0, 0.0]), 0.1 * np.eye(3), np.eye(3)))
        weights.append(1.0 / noise[0, 0])
        assert adaptation.diagnostics()["weight.gnss"] == pytest.approx(weights[-1])
    assert weights == sorted(weights, reverse=True)
    assert weights[0] > 1.0
    assert weights[-1] < 2e-3


@pytest.mark.parametrize(("name", "value"), [("dof", 0.0), ("dof", -1.0), ("turns", 0)])
def test_a_senseless_parameter_is_refused(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        StudentT(**{name: value})
