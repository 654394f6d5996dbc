"""Weightings of a window: closed forms, constants of stated efficiency, robust scales, hardening, a regression."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar
from scipy.stats import chi, multivariate_normal

from simnav.estimators.models.channels import by_channel
from simnav.estimators.weightings.base import Factors, Weighting
from simnav.estimators.weightings.dynamic_covariance_scaling import DynamicCovarianceScaling, covariance_scaling
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.gradient_adaptive import GradientAdaptive, medians
from simnav.estimators.weightings.graduated_non_convexity import (
    GraduatedNonConvexity,
    softened_geman_mcclure,
    softened_truncated,
)
from simnav.estimators.weightings.m_estimators import (
    MEstimator,
    cauchy,
    constants,
    efficiency,
    geman_mcclure,
    huber,
    of_array,
    truncated,
    tukey,
)
from simnav.estimators.weightings.max_mixture import MaxMixture
from simnav.estimators.weightings.robust_weighting import weigh_motion
from simnav.estimators.weightings.switchable_constraints import SwitchableConstraints
from simnav.types import Datasheet, Instruments

SHEETS = Instruments(
    (
        Datasheet("gnss", "gnss_position", 1.0, np.array([2.0, 2.0, 4.0])),
        Datasheet("dvl", "dvl", 1.0, 0.1 * np.ones(3)),
        Datasheet("compass", "magnetic_compass", 1.0, np.array([0.02])),
    )
)
FUNCTIONS = {"huber": huber, "tukey": tukey, "cauchy": cauchy, "geman-mcclure": geman_mcclure,
             "dcs": covariance_scaling}  # fmt: skip
ROBUST = {
    **{name: lambda f=f: MEstimator(f, constants(f)) for name, f in FUNCTIONS.items() if name != "dcs"},
    "dcs": DynamicCovarianceScaling,
    "switchable": SwitchableConstraints,
    "gnc-tls": GraduatedNonConvexity,
    "gnc-gm": lambda: GraduatedNonConvexity("gm"),
    "max-mixture": MaxMixture,
    "gradient-adaptive": GradientAdaptive,
}


def factors(whitened, names=("gnss",), instrument=None, components=3, motion=None, sigma=1.0, iteration=1) -> Factors:
    """Factors with the given whitened residuals (M, 3), of noise sigma^2, and motion residuals (N, 15)."""
    whitened = np.atleast_2d(np.asarray(whitened, dtype=float))
    m = len(whitened)
    motion = np.zeros((m, 15)) if motion is None else motion
    return Factors(
        names,
        np.zeros(m, np.int64) if instrument is None else np.asarray(instrument),
        np.broadcast_to(components, m).astype(np.int64),
        np.arange(m, dtype=float),
        whitened * sigma,
        np.broadcast_to(sigma**2 * np.eye(3), (m, 3, 3)),
        whitened,
        np.linalg.norm(whitened, axis=1),
        np.arange(len(motion), dtype=float),
        motion,
        np.linalg.norm(motion, axis=1),
        np.ones(m),
        np.ones(len(motion)),
        iteration,
    )


def along(norms) -> np.ndarray:
    """Whitened residuals of given norms."""
    return np.outer(norms, np.array([2.0, -1.0, 2.0]) / 3.0)


def weights(weighting: Weighting, norms, components=3) -> np.ndarray:
    """The weights of residuals of given norms, at the second iteration of an epoch."""
    weighting.reset(SHEETS)
    f = factors(along(norms), components=components, iteration=0)
    weighting.weigh(f)
    f.iteration = 1
    weighting.weigh(f)
    return f.weight


def test_the_base_lets_all_count_in_full():
    f = factors(along([1.0, 100.0]))
    f.weight[:], f.motion_weight[:] = 0.3, 0.4
    assert Weighting().weigh(f) is True
    assert f.weight.tolist() == [1.0, 1.0]
    assert f.motion_weight.tolist() == [1.0, 1.0]


# M-estimators


def test_weight_functions_in_closed_form():
    u = np.array([0.0, 0.5, 1.0, 2.0, 1e6])
    np.testing.assert_allclose(of_array(huber, u), [1.0, 1.0, 1.0, 0.5, 1e-6])
    np.testing.assert_allclose(of_array(tukey, u), [1.0, 0.5625, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(of_array(cauchy, u), [1.0, 0.8, 0.5, 0.2, 1e-12], rtol=1e-9)
    np.testing.assert_allclose(of_array(geman_mcclure, u), [1.0, 0.64, 0.25, 0.04, 1e-24], rtol=1e-9)
    np.testing.assert_allclose(covariance_scaling(u), [1.0, 1.0, 1.0, 0.16, 4e-24], rtol=1e-9)


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
@given(u=st.floats(0.0, 1e4), step=st.floats(0.0, 10.0))
@settings(max_examples=100)
def test_a_weight_starts_at_one_and_never_rises(function, u: float, step: float):
    at = of_array(function, np.array([0.0, u, u + step]))
    assert at[0] == 1.0
    assert 0.0 <= at[2] <= at[1] <= 1.0


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
def test_influence_is_bounded_and_redescends_but_for_hubers(function):
    """The influence w r of a gross error tends to 0, Huber's to c."""
    influence = of_array(function, np.array([1e5])) * 1e5
    assert influence == pytest.approx(1.0 if function is huber else 0.0, abs=1e-4)


def test_one_dimensional_constants_are_the_textbooks():
    """Huber 1.345, Tukey 4.685, Cauchy 2.385: 95 % efficiency (Zhang 1997, table 1)."""
    assert [constants(f)[0] for f in (huber, tukey, cauchy)] == pytest.approx([1.345, 4.685, 2.385], abs=1e-3)


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
@pytest.mark.parametrize("m", [1, 2, 3])
def test_efficiency_is_that_of_the_derivative_form(function, m: int):
    """Huber's (E[div psi] / m)^2 / (E[psi' psi] / m), the divergence by differences, the integrals by quadrature."""
    c = constants(function)[m - 1]
    kinks = [0.0, c, 12.0]

    def mean(f) -> float:
        return sum(quad(lambda r: f(r) * chi.pdf(r, m), a, b)[0] for a, b in pairwise(kinks))

    def w(r: float) -> float:
        return float(of_array(function, np.array([r / c]))[0])

    def divergence(r: float) -> float:
        h = 1e-6 * max(r, 1e-3)
        return m * w(r) + r * (w(r + h) - w(r - h)) / (2.0 * h)

    assert mean(divergence) ** 2 / (m * mean(lambda r: (w(r) * r) ** 2)) == pytest.approx(0.95, abs=2e-3)


def test_efficiency_is_what_a_location_shows():
    """10000 M-estimates of the mean of 60 Gaussian vectors: their variance is 1/0.95 of the mean's."""
    rng = np.random.default_rng(1)
    x = rng.standard_normal((10000, 60, 3))
    c = constants(tukey)[2]
    mean = x.mean(axis=1, keepdims=True)
    estimate = mean
    for _ in range(30):
        w = of_array(tukey, np.linalg.norm(x - estimate, axis=2) / c)[..., None]
        estimate = (w * x).sum(axis=1, keepdims=True) / w.sum(axis=1, keepdims=True)
    assert np.var(mean) / np.var(estimate) == pytest.approx(0.95, abs=0.02)


def test_dcs_with_the_papers_constant_wastes_half_of_three_components():
    assert efficiency(covariance_scaling, 1.0, 3) == pytest.approx(0.476, abs=0.01)


def test_the_constant_follows_the_number_of_components():
    for m, c in zip((1, 2, 3), constants(huber)):
        at = weights(MEstimator(huber, constants(huber)), [c * 0.999, c * 2.0], components=m)
        assert at == pytest.approx([1.0, 0.5])


@pytest.mark.parametrize("name", sorted(ROBUST))
def test_a_smallest_weight_is_kept_where_there_is_one(name: str):
    """A weight never locks a wrong window out for ever; max-mixture's wide component does it by itself."""
    least = {"huber": 1e-3, "max-mixture": 0.01, "gradient-adaptive": 0.5}.get(name, 1e-3)
    clean = along(np.full(9, 1.5))
    w = ROBUST[name]()
    w.reset(SHEETS)
    f = factors(np.vstack([clean, along([1e6])]), iteration=0)
    for k in range(60):
        f.iteration = k
        if w.weigh(f) and k > 0:
            break
    assert f.weight[-1] == pytest.approx(least)


def test_literature_form_without_a_smallest_weight():
    assert weights(MEstimator(tukey, constants(tukey), smallest=0.0), [6.0]) == 0.0


@pytest.mark.parametrize("name", [n for n in ROBUST if n != "gradient-adaptive"])
def test_an_epoch_begins_with_the_weights_of_the_last(name: str):
    """A new measurement counts in full until the window has been solved with it."""
    w = ROBUST[name]()
    w.reset(SHEETS)
    f = factors(along([1.0, 20.0]), iteration=0)
    f.weight[:] = [0.25, 1.0]
    assert w.weigh(f) is False
    assert f.weight.tolist() == [0.25, 1.0]


@pytest.mark.parametrize("name", sorted(ROBUST))
def test_weights_do_not_depend_on_the_axes_or_the_unit(name: str):
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    residuals = np.random.default_rng(4).standard_normal((12, 3)) * np.array([1.0] * 10 + [8.0, 20.0])[:, None]
    found = []
    for r, sigma in ((residuals, 1.0), (residuals @ turn.T, 1.0), (residuals, 1e-3)):
        w = ROBUST[name]()
        w.reset(SHEETS)
        f = factors(r, sigma=sigma, iteration=0)
        for k in range(40):
            f.iteration = k
            w.weigh(f)
        found.append(f.weight)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)
    np.testing.assert_allclose(found[2], found[0], rtol=1e-9)


@pytest.mark.parametrize("n", [3, 9, 15, 22])
def test_motion_counts_in_full_up_to_the_quantile_and_then_as_noisy_as_it_shows(n: int):
    limit = chi.ppf(0.999, n)
    motion = np.zeros((4, n))
    motion[:, 0] = np.array([0.0, 0.99, 2.0, 100.0]) * limit
    f = factors(along(np.ones(4)), motion=motion)
    weigh_motion(f)
    np.testing.assert_allclose(f.motion_weight, [1.0, 1.0, 0.25, 1e-4], rtol=0.02)
    np.testing.assert_allclose((f.motion_weight**0.5 * f.motion_norm)[2:], limit, rtol=0.01)


# Dynamic covariance scaling and switchable constraints


def test_dcs_with_a_given_phi():
    """s = min(1, 2F / (F + chi^2)), information times s^2 (Agarwal et al. 2013, eq. 15)."""
    chi2 = np.array([0.0, 1.9, 2.0, 6.0, 30.0])
    s = np.minimum(1.0, 4.0 / (2.0 + chi2))
    np.testing.assert_allclose(weights(DynamicCovarianceScaling(phi=2.0), chi2**0.5), s**2)


def test_the_switch_eliminated_is_the_best_switch():
    """s = F / (F + chi^2) minimises s^2 chi^2 + (s - 1)^2 / sigma_s^2, and the weight is s^2."""
    sigma, chi2 = 0.7, 5.0
    best = minimize_scalar(lambda s: s * s * chi2 + ((s - 1.0) / sigma) ** 2).x
    assert weights(SwitchableConstraints(sigma), [chi2**0.5], components=1) == pytest.approx(best**2, rel=1e-6)


def test_eliminated_switches_find_the_minimum_of_the_joint_problem():
    """A location with an outlier, once with the switches as unknowns and once by weights."""
    x = np.array([0.3, -0.2, 0.1, 0.4, 9.0])
    sigma = 0.5
    switches = np.ones(5)
    at = 0.0
    for _ in range(300):  # alternate exact minimisation of the joint cost
        at = float(np.sum(switches**2 * x) / np.sum(switches**2))
        switches = 1.0 / (1.0 + (sigma * (x - at)) ** 2)
    weighting = SwitchableConstraints(sigma)
    by_weights = 0.0
    for _ in range(300):
        w = weights(weighting, np.abs(x - by_weights), components=1)
        by_weights = float(np.sum(w * x) / np.sum(w))
    assert by_weights == pytest.approx(at, abs=1e-9)


@given(chi2=st.floats(0.0, 400.0), phi=st.floats(0.2, 20.0))
@settings(max_examples=100)
def test_dcs_is_twice_the_switch_and_at_most_one(chi2: float, phi: float):
    """With F = 1/sigma_s^2, DCS scales by min(1, 2 s) where a switch is s."""
    switch = weights(SwitchableConstraints(phi**-0.5, smallest=0.0), [chi2**0.5], components=1)[0] ** 0.5
    scaled = weights(DynamicCovarianceScaling(phi, smallest=0.0), [chi2**0.5], components=1)[0] ** 0.5
    assert scaled == pytest.approx(min(1.0, 2.0 * switch), rel=1e-9)


# Max-mixture


@pytest.mark.parametrize("m", [1, 2, 3])
def test_max_mixture_picks_the_more_probable_component(m: int):
    s, p = 8.0, 0.1
    for norm in np.linspace(0.0, 12.0, 49):
        x = np.zeros(m)
        x[0] = norm
        nominal = np.log(1 - p) + multivariate_normal.logpdf(x, np.zeros(m), np.eye(m))
        wide = np.log(p) + multivariate_normal.logpdf(x, np.zeros(m), s * s * np.eye(m))
        expected = 1.0 if nominal > wide else s**-2
        assert weights(MaxMixture(s, p), [norm], components=m) == pytest.approx(expected)


# In kernels


NORMS = np.concatenate([[0.0, 1e-300, 1e12, np.nan], np.random.default_rng(4).uniform(0.0, 12.0, 200)])


@pytest.mark.parametrize("function", [huber, tukey, cauchy, geman_mcclure])
@pytest.mark.parametrize("m", [1, 2, 3])
def test_a_weight_in_a_kernel_is_that_of_the_array_to_the_last_bit(function, m: int):
    c = constants(function)
    f = factors(along(NORMS), components=m)
    MEstimator(function, c).choose(f)
    np.testing.assert_array_equal(f.weight, of_array(function, f.norm * (1.0 / np.array(c))[m - 1]))


@pytest.mark.parametrize(("cost", "function"), [("tls", softened_truncated), ("gm", softened_geman_mcclure)])
def test_softened_weights_in_a_kernel_are_those_of_the_array_to_the_last_bit(cost: str, function):
    """Without an outlier among the new measurements mu is the last one."""
    weighting = GraduatedNonConvexity(cost, smallest=0.0)
    weighting.reset(SHEETS)
    norms = NORMS[np.isfinite(NORMS)]
    scale = constants(truncated if cost == "tls" else geman_mcclure, 0.95)[2] ** -2.0
    mu = 10.0 if cost == "tls" else 1.0
    weighting._seen = weighting._newest = np.inf
    f = factors(along(norms))
    weighting._fresh, f.iteration = True, 1
    assert weighting.weigh(f)
    np.testing.assert_array_equal(f.weight, function.function(f.norm * f.norm * scale, mu))


# Graduated non-convexity


def test_softened_costs_end_as_the_hard_ones_and_begin_convex():
    square = np.linspace(0.0, 9.0, 901)
    np.testing.assert_allclose(softened_geman_mcclure.function(square, 1.0), of_array(geman_mcclure, square**0.5))
    away = np.abs(square - 1.0) > 1e-3
    np.testing.assert_allclose(softened_truncated.function(square, 1e4)[away], truncated(square**0.5)[away])
    # Soft enough, the cost of every residual up to u^2 = 9 has a positive second derivative: w + u w' > 0.
    for soft, mu in ((softened_geman_mcclure, 30.0), (softened_truncated, 1.0 / 17.0)):
        u = np.linspace(0.01, 2.99, 300)
        influence = soft.function(u * u, mu) * u
        assert np.all(np.diff(influence) > -1e-9 if soft is softened_geman_mcclure else influence > 0.0)


def test_the_band_of_truncated_least_squares_in_closed_form():
    """Yang et al. 2020, eq. 14: 1 below mu/(mu + 1), 0 above (mu + 1)/mu, continuous at both."""
    mu = 3.0
    low, high = mu / (mu + 1.0), (mu + 1.0) / mu
    square = np.array([0.5 * low, low, 1.0, high, 2.0 * high])
    expected = [1.0, 1.0, np.sqrt(mu * (mu + 1.0)) - mu, 0.0, 0.0]
    np.testing.assert_allclose(softened_truncated.function(square, mu), expected, atol=1e-12)


@pytest.mark.parametrize("cost", ["tls", "gm"])
def test_it_hardens_only_where_there_is_an_outlier(cost: str):
    weighting = GraduatedNonConvexity(cost)
    weighting.reset(SHEETS)

    def epoch(f: Factors) -> int:
        for k in range(100):
            f.iteration = k
            if weighting.weigh(f):
                return k
        raise AssertionError("never settles")

    calm = along([1.0, 2.0, 1.5])
    assert epoch(factors(calm)) == 1
    f = factors(np.vstack([calm, along([25.0])]))
    assert epoch(f) > 3
    hard = truncated if cost == "tls" else geman_mcclure
    np.testing.assert_allclose(f.weight, np.maximum(of_array(hard, f.norm / constants(hard)[2]), 1e-3), rtol=1e-9)
    assert epoch(factors(np.vstack([calm, along([25.0, 1.0])]))) == 1  # the old outlier begins no new schedule


def voted(readings, names, cost="tls"):
    """Weights of readings of one number at one time, softly held at zero, and whether mu went by steps."""
    sheets = [Datasheet("gnss", "gnss_raw", 1.0, np.ones(1), channels=tuple("ABCDEF")), SHEETS["compass"]]
    weighting, f = GraduatedNonConvexity(cost), factors(along(readings), names, range(len(readings)), components=1)
    weighting.reset(by_channel(Instruments(sheets)))
    f.time[:] = 0.0
    schedule = []
    for k in range(40):
        x = f.weight @ readings / (f.weight.sum() + 1e-4)
        f.norm, f.iteration = abs(readings - x), k
        if weighting.weigh(f) and k > 10:
            break
        schedule.append(weighting.diagnostics()["mu"])
    return f.weight, len(set(schedule)) > 2  # more than the first mu and the last


@pytest.mark.parametrize(("wrong", "searched"), [([300.0], False), ([300.0, -80.0], False), ([50.0] * 3, True)])
def test_channels_tell_which_of_them_is_wrong(wrong, searched):
    """Fewer than half are left out without a schedule of mu; against three of six there is no majority."""
    readings = np.array([*(0.3, -0.4, 2.5, 0.1)[: 6 - len(wrong)], *wrong])
    weight, changed = voted(readings, [f"gnss:{c}" for c in "ABCDEF"[: len(readings)]])
    assert changed == searched
    if not searched:
        np.testing.assert_array_equal(weight, np.where(abs(readings) < 3.0, 1.0, 1e-3))


def test_a_measurement_of_another_instrument_is_not_left_out_by_a_vote():
    readings = np.array([0.3, -0.4, 0.1, 0.2, -30.0])
    assert voted(readings, ["gnss:A", "gnss:B", "gnss:C", "gnss:D", "compass"])[1]
    assert not voted(np.append(readings[:4], -30.0), ["gnss:A", "gnss:B", "gnss:C", "gnss:D", "gnss:E"])[1]


# Gradient-adaptive


def test_medians_are_numpys():
    rng = np.random.default_rng(5)
    values, group = rng.random(41), rng.integers(0, 4, 41)
    group[group == 2] = 3  # a group of none
    found = np.empty(5)
    medians(values, group, 1, found)
    for g in (0, 1, 3):
        assert found[g] == np.median(values[group == g])
    assert found[2] == found[4] == 1.0


@pytest.mark.parametrize(("m", "constant"), [(1, 1.4826), (2, 0.849), (3, 0.650)])
def test_the_scale_is_consistent(m: int, constant: float):
    """On Gaussian residuals s is sigma, whatever the number of components; the constant is 1 / median(chi_m)."""
    assert constant == pytest.approx(1.0 / chi.median(m), abs=1e-3)
    x = 3.0 * np.random.default_rng(6).standard_normal((40001, 3))
    x[:, m:] = 0.0
    weighting = GradientAdaptive()
    weighting.reset(SHEETS)
    weighting.weigh(factors(x, components=m))
    assert weighting.diagnostics()["scale.gnss"] == pytest.approx(3.0, rel=0.02)


def test_the_printed_scale_is_not():
    """1.4826 median of the norms of three components is 2.28 sigma (eq. 20)."""
    x = np.random.default_rng(7).standard_normal((40001, 3))
    weighting = GradientAdaptive("paper")
    weighting.reset(SHEETS)
    weighting.weigh(factors(x))
    assert weighting.diagnostics()["scale.gnss"] == pytest.approx(2.28, rel=0.02)


def test_weights_as_printed():
    """Eqs. 19-21 with the printed constants, on unwhitened residuals, by hand."""
    names, instrument = ("gnss", "dvl"), np.array([0, 0, 0, 1, 1, 1])
    norms = np.array([3.0, 4.0, 40.0, 0.1, 0.2, 2.0])
    motion = np.zeros((3, 15))
    motion[:, 0], motion[:, 12] = [0.2, 0.3, 3.0], 7.0
    f = factors(along(norms), names, instrument, motion=motion, sigma=1.0)
    f.norm[:] = 0.0  # not to be used
    weighting = GradientAdaptive("paper")
    weighting.reset(SHEETS)
    assert weighting.weigh(f) is True

    def by_hand(r, a, c, least):
        scaled = r / (1.4826 * np.median(r) + 0.1)
        return np.clip(a / (1.0 + scaled**2 / c**2), least, 1.0)

    np.testing.assert_allclose(f.weight[:3], by_hand(norms[:3], 3.0, 1.5, 0.5))
    np.testing.assert_allclose(f.weight[3:], by_hand(norms[3:], 2.0, 1.0, 0.3))
    np.testing.assert_allclose(f.motion_weight, by_hand(motion[:, 0], 2.0, 1.0, 0.3))
    assert f.weight[2] == 0.5
    assert f.motion_weight[2] == 0.3


def test_the_scale_is_never_below_the_datasheet_nor_of_a_few():
    weighting = GradientAdaptive()
    weighting.reset(SHEETS)
    weighting.weigh(factors(along(np.full(20, 0.05))))
    assert weighting.diagnostics()["scale.gnss"] == 1.0
    f = factors(along([1.0, 30.0, 40.0]))
    weighting.weigh(f)
    assert weighting.diagnostics()["scale.gnss"] == 1.0
    assert f.weight.tolist() == [1.0, 0.5, 0.5]


def test_a_fault_that_fills_the_window_becomes_the_scale():
    """The known defect: every residual of 25 sigma, and no weight below the largest."""
    weighting = GradientAdaptive()
    weighting.reset(SHEETS)
    f = factors(along(np.full(20, 25.0)))
    weighting.weigh(f)
    assert f.weight.min() == 1.0


def test_motion_counts_by_its_blocks_of_three():
    """Residuals as large as the noise in all 15 components lie in the dead zone, ten times as large do not."""
    weighting = GradientAdaptive(motion=(2.0, 2.0, 0.3))
    weighting.reset(SHEETS)
    motion = np.ones((8, 15))
    motion[7] *= 10.0
    f = factors(along(np.ones(8)), motion=motion)
    weighting.weigh(f)
    assert weighting.diagnostics()["scale.motion"] == pytest.approx(1.0)
    np.testing.assert_allclose(f.motion_weight[:7], 1.0)
    assert f.motion_weight[7] == 0.3


# All of them, on a regression


def regression(weighting: Weighting | None, outliers: float, seed: int, iterations: int = 60) -> tuple[float, int]:
    """Error of a constant velocity fitted to 40 positions, of which some are wrong by 10 to 40 sigma; iterations."""
    rng = np.random.default_rng(seed)
    t = np.linspace(-1.0, 1.0, 40)
    design = np.stack([np.kron([1.0, x], np.eye(3)) for x in t])  # (40, 3, 6)
    truth = rng.standard_normal(6)
    z = design @ truth + rng.standard_normal((40, 3))
    hit = rng.random(40) < outliers
    z[hit] += rng.uniform(10.0, 40.0, (hit.sum(), 1)) * rng.choice([-1.0, 1.0], (hit.sum(), 3)) / 3**0.5
    x, w = np.zeros(6), np.ones(40)
    for k in range(iterations):
        settled = True
        if weighting is not None:
            f = factors(z - design @ x, iteration=k)
            f.weight[:] = w
            settled = weighting.weigh(f)
            w = f.weight
        normal = np.einsum("k,kij,kil->jl", w, design, design)
        step = np.linalg.solve(normal, np.einsum("k,kij,ki->j", w, design, z - design @ x))
        x = x + step
        if settled and np.abs(step).max() < 1e-6:
            break
    return float(np.sqrt(np.mean((x - truth) ** 2))), k + 1


@pytest.mark.parametrize("share", [0.05, 0.2])
@pytest.mark.parametrize("name", sorted(ROBUST))
def test_a_robust_regression_beats_least_squares(name: str, share: float):
    errors = []
    for seed in range(30):
        weighting = ROBUST[name]()
        weighting.reset(SHEETS)
        robust, iterations = regression(weighting, share, seed)
        assert iterations < 60
        errors.append((robust, regression(None, share, seed)[0]))
    robust, plain = np.sqrt(np.mean(np.square(errors), axis=0))
    # Gradient-adaptive weights leave an outlier half of its information.
    assert robust < (0.8 if name == "gradient-adaptive" else 0.4) * plain


@pytest.mark.parametrize("name", sorted(ROBUST))
def test_a_clean_regression_loses_little(name: str):
    """The variance is at most 1 / 0.9 of least squares'."""
    pairs = []
    for seed in range(60):
        weighting = ROBUST[name]()
        weighting.reset(SHEETS)
        pairs.append((regression(weighting, 0.0, seed)[0], regression(None, 0.0, seed)[0]))
    robust, plain = np.sqrt(np.mean(np.square(pairs), axis=0))
    assert robust < 1.06 * plain


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MEstimator(huber, (1.0, 0.0, 1.0)), "constants"),
        (lambda: MEstimator(huber, (1.0, 1.0, 1.0), smallest=2.0), "smallest = 2"),
        (lambda: constants(huber, 1.0), "efficiency = 1"),
        (lambda: DynamicCovarianceScaling(phi=-1.0), "phi = -1"),
        (lambda: SwitchableConstraints(0.0), "sigma = 0"),
        (lambda: MaxMixture(spread=1.0), "spread = 1"),
        (lambda: MaxMixture(probability=0.0), "probability = 0"),
        (lambda: MaxMixture(spread=1.1, probability=0.9), "at any residual"),
        (lambda: GraduatedNonConvexity("l1"), "cost = 'l1'"),
        (lambda: GraduatedNonConvexity(growth=1.0), "growth = 1"),
        (lambda: GraduatedNonConvexity(smallest=-1.0), "smallest = -1"),
        (lambda: FaultIsolation(together=-1), "together = -1"),
        (lambda: FaultIsolation(recent=-1.0), "recent = -1"),
        (lambda: FaultIsolation(sound=1.0), "sound = 1"),
        (lambda: GradientAdaptive("print"), "preset = 'print'"),
        (lambda: GradientAdaptive(gnss=(1.0, 0.0, 0.5)), "gnss ="),
        (lambda: GradientAdaptive(epsilon=0.0), "epsilon = 0"),
    ],
)
def test_settings_that_cannot_be(make, message: str):
    with pytest.raises(ValueError, match=message):
        make()


# Whose fault it is


class Isolated(Weighting):
    """A weighting and the isolation after it, as a window asks them."""

    def __init__(self, sheets: Instruments):
        self.weighting, self.isolation = MEstimator(tukey, constants(tukey)), FaultIsolation()
        self.weighting.reset(sheets)
        self.isolation.reset(sheets)

    def weigh(self, factors: Factors) -> bool:
        settled = self.weighting.weigh(factors)
        return self.isolation.judge(factors) and settled


def asked(agree: bool) -> list[Factors]:
    """Three epochs in which fix and DVL fail, and what follows at the third when motion has been loosened."""
    weighting = Isolated(SHEETS)
    seen = []
    for epoch in (1, 2, 3):
        instrument = np.tile([0, 1], epoch)
        f = factors(along(np.full(2 * epoch, 40.0)), ("gnss", "dvl"), instrument, motion=np.zeros((epoch, 15)))
        f.time[:] = np.repeat(np.arange(1.0, epoch + 1.0), 2)
        f.motion_time[:] = np.arange(1.0, epoch + 1.0)
        for k in range(6):
            f.iteration = k
            settled = weighting.weigh(f)
            if not settled and k == 1:
                seen.append(replace(f, weight=f.weight.copy(), motion_weight=f.motion_weight.copy()))
                norm, motion = (1.0, 1e3) if agree else (20.0, 1e3)
                f.norm[:], f.motion_norm[:] = norm, motion
            if settled:
                break
        seen.append(f)
    return seen


def test_fixes_and_logs_that_fail_together_are_asked():
    first, second, asking, _ = asked(agree=True)
    for f in (first, second):
        assert f.weight.max() == 1e-3
        assert f.motion_weight.min() == 1.0
    assert asking.weight.min() == 1.0
    assert asking.motion_weight.max() == 1e-6


def test_the_motion_is_blamed_where_they_agree():
    blamed = asked(agree=True)[-1]
    assert blamed.weight.min() == 1.0
    assert blamed.motion_weight.max() == pytest.approx((chi.ppf(0.999, 15) / 1e3) ** 2, rel=0.02)


def test_the_measurements_are_blamed_where_they_do_not():
    denied = asked(agree=False)[-1]
    assert denied.iteration == 3  # one to ask, one back
    assert denied.weight.max() == 1e-3


@pytest.mark.parametrize("directed", [True, False])
def test_without_a_log_the_motion_is_asked_where_fixes_fail_in_one_direction(directed: bool):
    """A larger noise has no direction. The window then keeps its weights."""
    weighting, asked = Isolated(Instruments([SHEETS["gnss"]])), []
    for epoch in range(1, 8):
        sign = 1.0 if directed else (-1.0) ** np.arange(epoch)
        f = factors(along(40.0 * sign * np.ones(epoch)), iteration=0)
        weighting.weigh(f)
        f.iteration = 1
        asked.append(weighting.weigh(f) is False)
        assert asked[-1] or f.weight.max() == 1e-3
    assert any(asked) == directed


def lone(
    epochs: int, norms: dict[float, float], fix_until: float = 1.0, fold: float = 0.0
) -> list[tuple[Factors, bool]]:
    """What is asked, epoch by epoch, if the DVL fails from second 1 on, and fixes pass until a time.

    ``norms`` are the norms of the DVL's readings by their times where the motion is loosened; ``fold`` is how long
    after its node each reading was taken [s]. The result has the factors of each epoch when they were final, and
    whether the motion was tested.
    """
    weighting = Isolated(SHEETS)
    found = []
    for epoch in range(1, epochs + 1):
        nodes = np.arange(1.0, epoch + 1.0)
        fixed = nodes[nodes <= fix_until]
        time = np.concatenate([nodes + fold, fixed])
        order = np.argsort(time, kind="stable")
        kind = np.concatenate([np.ones(epoch, int), np.zeros(len(fixed), int)])[order]
        size = np.where(kind == 1, 40.0, 0.5)
        f = factors(along(size), ("gnss", "dvl"), kind, motion=np.zeros((epoch, 15)))
        f.time[:], f.motion_time[:] = time[order], nodes
        tested = False
        for k in range(6):
            f.iteration = k
            settled = weighting.weigh(f)
            loose = f.motion_weight <= 1e-6
            if loose.any():
                tested = True
                f.norm[:] = [norms.get(t, s) for t, s in zip(f.time.tolist(), size.tolist(), strict=True)]
                f.motion_norm[loose] = 1e3
                shown = loose.copy()
            elif not settled:
                f.norm[:], f.motion_norm[:] = size, 0.0
            if settled:
                break
        found.append((replace(f, motion_norm=shown if tested else np.zeros(epoch)), tested))
    return found


def test_a_lone_log_is_believed_against_the_motion():
    seen = lone(9, {float(t): 1.0 for t in range(1, 10)})
    assert [tested for _, tested in seen[:7]] == [False] * 6 + [True]  # until then fixes may still come
    assert seen[6][0].weight.min() == 1.0


def test_a_log_is_not_alone_while_fixes_come():
    assert not any(tested for _, tested in lone(9, {}, fix_until=9.0))


def test_a_lone_log_that_contradicts_itself_is_asked_again_by_its_newest_readings():
    """What a wrong motion folded onto a node never agrees; later readings do."""
    seen = lone(12, {float(t): 1.0 for t in range(8, 13)})
    asked_at = [k + 1 for k, (_, tested) in enumerate(seen) if tested]
    assert asked_at[:2] == [7, 10]
    last = seen[9][0]
    assert np.array_equal(last.weight[last.instrument == 1] == 1.0, np.arange(1, 11) >= 8)


def test_the_motion_to_the_node_of_a_folded_reading_is_loosened():
    plain, folded = (lone(7, {t + f: 1.0 for t in range(1, 8)}, fold=f)[6][0].motion_norm for f in (0.0, 0.4))
    assert np.array_equal(plain, folded)
    assert plain.all()
