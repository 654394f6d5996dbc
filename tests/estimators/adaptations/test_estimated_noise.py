"""Sage-Husa, IAE, RAE and variational Bayes on synthetic stationary innovations: closed forms and convergence."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.adaptations.innovation_based import InnovationBased, adaptive_window
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.adaptations.variational_bayes import VariationalBayes
from simnav.estimators.algebra.direct_update import posterior
from simnav.types import Datasheet, Instruments, Measurement

GNSS = Instruments((Datasheet("gnss", "gnss_position", 1.0, np.array([1.0, 1.0, 2.0])),))
NOMINAL = np.diag([1.0, 1.0, 4.0])
PREDICTED = np.array([[0.5, 0.1, 0.0], [0.1, 0.4, 0.05], [0.0, 0.05, 0.8]])
TRUE = np.array([[9.0, 2.0, 0.0], [2.0, 4.0, 1.0], [0.0, 1.0, 25.0]])


def innovations(n: int, noise: np.ndarray = TRUE, seed: int = 0, predicted: np.ndarray = PREDICTED) -> list[Innovation]:
    """Stationary innovations of covariance H P H' + R."""
    rng = np.random.default_rng(seed)
    v = rng.multivariate_normal(np.zeros(3), predicted + noise, n)
    return [
        Innovation(Measurement(float(k), "gnss", "gnss_position", np.zeros(3)), v[k], predicted.copy(), NOMINAL.copy())
        for k in range(n)
    ]


def feed(adaptation, given: list[Innovation]) -> list[np.ndarray]:
    adaptation.reset(GNSS)
    return [adaptation.adapt(i) for i in given]


@pytest.mark.parametrize(
    "adaptation",
    [
        SageHusa(fading=1.0, full=True),
        InnovationBased("innovation", 4000, 4000, full=True),
        InnovationBased("residual", 4000, 4000, full=True),
        InnovationBased("innovation", 4000, 4000, newest=True, full=True),
    ],
    ids=["sage-husa", "iae", "rae", "iae eq. 17"],
)
def test_a_full_estimate_converges_to_the_true_noise(adaptation):
    last = feed(adaptation, innovations(12000))[-1]
    np.testing.assert_allclose(last, TRUE, rtol=0.06, atol=0.5)


@pytest.mark.parametrize(
    "adaptation",
    [
        SageHusa(fading=0.999),
        SageHusa(fading=1.0),
        InnovationBased("innovation", 3000, 3000),
        InnovationBased("residual", 3000, 3000),
        VariationalBayes(forgetting=0.999),
    ],
    ids=["fading", "sage-husa", "iae", "rae", "vb"],
)
def test_variances_converge_to_the_true_ones(adaptation):
    noise = np.diag([9.0, 4.0, 25.0])
    last = feed(adaptation, innovations(9000, noise))[-1]
    np.testing.assert_allclose(np.diag(last), np.diag(noise), rtol=0.1)


def test_sage_husa_without_fading_is_the_mean_of_all():
    """The datasheet's R counts as ``prior + 1`` samples."""
    given = innovations(50, seed=1)
    samples = [np.outer(i.residual, i.residual) - PREDICTED for i in given]
    got = feed(SageHusa(1.0, prior=3, lowest=1e-6, highest=1e6, full=True), given)
    for k in (0, 7, 49):
        mean = (4 * NOMINAL + sum(samples[: k + 1])) / (5 + k)
        if np.linalg.eigvalsh(mean).min() > 0.1:
            np.testing.assert_allclose(got[k], mean, atol=1e-9)
    assert np.linalg.eigvalsh((4 * NOMINAL + sum(samples)) / 54).min() > 0.1


def test_sage_husa_with_fading_is_the_weighted_mean():
    given, b = innovations(40, np.diag([9.0, 16.0, 25.0]), seed=2), 0.9
    got = np.diag(feed(SageHusa(b, prior=0, lowest=1e-6, highest=1e6), given)[-1])
    samples = np.array([np.diag(NOMINAL), *(i.residual**2 - np.diag(PREDICTED) for i in given)])
    weights = b ** np.arange(40, -1, -1.0)
    np.testing.assert_allclose(got, weights @ samples / weights.sum(), rtol=1e-9)


def test_a_fixed_window_is_eqs_16_to_18():
    """An independent recursion: mean of the last M outer products less H P H', then a = 0.9 of it."""
    given, m = innovations(60, seed=3), 12
    for newest in (True, False):
        got = feed(InnovationBased("innovation", m, m, forgetting=0.9, newest=newest, full=True, lowest=1e-6), given)
        before = None
        for k in range(60):
            recent = [np.outer(i.residual, i.residual) for i in given[max(0, k - m + 1) : k + 1]]
            # What the window lacks is filled by the nominal S
            s = (sum(recent) + (m - len(recent)) * (NOMINAL + PREDICTED)) / m
            now = s - PREDICTED
            before = now if before is None else 0.1 * before + 0.9 * now
            if np.linalg.eigvalsh(before).min() > 1e-3:
                np.testing.assert_allclose(got[k], before, atol=1e-9)


def test_each_innovation_has_its_own_prediction():
    """With a P that shrinks, eq. 17 as printed is biased upwards; the default is not."""
    rng = np.random.default_rng(4)
    noise, nominal = np.diag([2.0, 2.0, 8.0]), 30.0 * np.eye(3)
    given = []
    for k in range(400):
        p = np.eye(3) * 25.0 * 0.99**k  # always better than the nominal measurement
        v = rng.multivariate_normal(np.zeros(3), p + noise)
        given.append(Innovation(Measurement(k, "gnss", "gnss_position", np.zeros(3)), v, p, nominal))
    window = {"shortest": 200, "longest": 200, "forgetting": 1.0, "lowest": 1e-3}
    found = {}
    for newest in (True, False):
        adaptation = InnovationBased(**window, newest=newest)
        adaptation.reset(GNSS)
        found[newest] = np.diag([adaptation.choose(i) for i in given][-1])
    variances = [i.predicted[0, 0] for i in given[200:]]
    np.testing.assert_allclose(found[True] - found[False], np.mean(variances) - variances[-1])
    assert np.mean(variances) - variances[-1] > 0.5
    np.testing.assert_allclose(found[False], np.diag(noise), atol=2.0)


@pytest.mark.parametrize(
    "adaptation", [SageHusa(), InnovationBased(), VariationalBayes()], ids=["sage-husa", "iae", "vb"]
)
def test_an_innovation_of_a_poor_prediction_says_nothing_of_the_noise(adaptation):
    """The noise used last stands, and the estimate goes on as if the innovation had not been."""
    usual, poor = innovations(60), innovations(30, seed=1, predicted=1e4 * np.eye(3))
    adaptation.together = 0
    with_poor = feed(adaptation, [*usual[:40], *poor, *usual[40:]])
    np.testing.assert_array_equal(with_poor[40:70], [with_poor[39]] * 30)
    without = feed(adaptation, usual)
    np.testing.assert_allclose(with_poor[70:], without[40:], rtol=1e-12)
    assert np.ptp([noise[0, 0] for noise in without]) > 0.0


def test_the_window_of_eq_20():
    assert [adaptive_window(v, 10.0, 2.0, 5.0, 10, 20) for v in (1.0, 20.0, 20.1, 50.0, 50.1)] == [10, 10, 15, 15, 20]


def test_the_window_grows_with_the_scatter():
    """Window lengths after innovations of 1, 1.8 and 5 sigma, reported as a diagnostic."""
    adaptation = InnovationBased(shortest=10, longest=20)
    for scale, length in ((1.0, 10), (1.8, 15), (5.0, 20)):
        given = [i._replace(residual=i.residual * scale) for i in innovations(200, NOMINAL, seed=5)]
        adaptation.reset(GNSS)
        lengths = []
        for i in given:
            adaptation.adapt(i)
            lengths.append(adaptation.diagnostics()["window.gnss"])
        assert np.median(lengths[30:]) == length


def test_variational_bayes_is_algorithm_1():
    """One step by hand, with two iterations."""
    given = innovations(1, seed=6)[0]
    adaptation = VariationalBayes(forgetting=0.9, prior=10.0, iterations=2, lowest=1e-3)
    adaptation.reset(GNSS)
    got = adaptation.adapt(given)
    shape, before = 0.9 * 5.0 + 0.5, 0.9 * 5.0 * np.diag(NOMINAL)
    noise = NOMINAL.copy()  # before the measurement: b/a = nominal
    for _ in range(2):
        gain = PREDICTED @ np.linalg.inv(PREDICTED + noise)
        left = given.residual - gain @ given.residual
        after = PREDICTED - gain @ PREDICTED
        noise = np.diag((before + 0.5 * (left**2 + np.diag(after))) / shape)
    np.testing.assert_allclose(got, noise, rtol=1e-10)


def test_posterior_against_the_textbook():
    given = innovations(1, seed=7)[0]
    gain = PREDICTED @ np.linalg.inv(PREDICTED + TRUE)
    residual, after = np.empty(3), np.empty((3, 3))
    nis = posterior(given.residual, PREDICTED, TRUE, residual, after)
    np.testing.assert_allclose(residual, given.residual - gain @ given.residual)
    np.testing.assert_allclose(after, PREDICTED - gain @ PREDICTED, atol=1e-12)
    assert nis == pytest.approx(given.residual @ np.linalg.solve(PREDICTED + TRUE, given.residual))


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.booleans(), st.floats(-6.0, 6.0))
def test_an_estimate_stays_within_its_bounds(seed: int, full: bool, exponent: float):
    """Whatever the innovations: eigenvalues in units of the nominal variances, and symmetric."""
    rng = np.random.default_rng(seed)
    given = [i._replace(residual=10.0**exponent * rng.standard_normal(3)) for i in innovations(12, seed=seed)]
    unit = np.sqrt(np.diag(NOMINAL))
    for adaptation in (
        SageHusa(0.9, 0, 0.5, 20.0, full),
        InnovationBased(shortest=3, longest=6, lowest=0.5, highest=20.0, full=full),
        InnovationBased("residual", 3, 6, lowest=0.5, highest=20.0, full=full),
    ):
        for noise in feed(adaptation, given):
            np.testing.assert_allclose(noise, noise.T, rtol=1e-9, atol=1e-9)
            values = np.linalg.eigvalsh(noise / np.outer(unit, unit))
            assert 0.25 * (1 - 1e-9) <= values.min() <= values.max() <= 400.0 * (1 + 1e-9)


def test_the_sigma_in_use_is_reported():
    adaptation = SageHusa()
    adaptation.reset(GNSS)
    assert adaptation.diagnostics()["sigma_down.gnss"] == 2.0
    used = adaptation.adapt(innovations(1)[0])
    reported = [adaptation.diagnostics()[f"sigma_{c}.gnss"] for c in ("north", "east", "down")]
    np.testing.assert_allclose(reported, np.sqrt(np.diag(used)))


def test_out_of_scope_is_left_alone():
    """A velocity in the default scope keeps its noise; with scope = all it does not."""
    sheet = Datasheet("v", "gnss_velocity", 1.0, np.ones(3))
    given = Innovation(Measurement(1.0, "v", "gnss_velocity", np.zeros(3)), 50.0 * np.ones(3), np.eye(3), np.eye(3))
    for scope, changed in (("fixes", False), ("all", True)):
        adaptation = SageHusa(scope=scope)
        adaptation.reset(Instruments((sheet,)))
        assert bool(adaptation.adapt(given)[0, 0] > 1.0) is changed


@pytest.mark.parametrize("source", ["innovation", "residual"])
def test_the_datasheet_stands_until_the_innovations_contradict_it(source):
    sound, noisy = innovations(4000, NOMINAL), innovations(200, 9.0 * NOMINAL)
    believed = feed(InnovationBased(source), sound)
    # three components, of which one may be improbable at 1 % on the side above (below, the bound is the datasheet)
    assert np.mean([np.array_equal(noise, NOMINAL) for noise in believed[20:]]) > 0.94
    assert all(np.trace(noise) > 2.0 * np.trace(NOMINAL) for noise in feed(InnovationBased(source), noisy)[20:])
    printed = feed(InnovationBased(source, significance=1.0), sound)
    assert np.mean([np.array_equal(noise, NOMINAL) for noise in printed[20:]]) < 0.2


def test_a_significance_is_a_probability():
    with pytest.raises(ValueError, match="significance = 0"):
        InnovationBased(significance=0.0)
