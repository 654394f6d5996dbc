"""All measurements of a step of the inertial filter in one kernel, with a noise that is chosen by each innovation.

For the rules of `RULES`, and for a mixture of levels. Each is a kernel of its adaptation, which also calls it by
itself, so that a filter has the same noise measurement by measurement.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, sqrt
from typing import TypeAlias

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.inflation import inflate_motion
from simnav.estimators.algebra.mixture import mixture_update
from simnav.estimators.models.base import INNOVATION, NIS, REJECTED, REPORT, RESULTS, SIGMA, SIZE, StepRule
from simnav.estimators.models.inertial_update import absorb_inertial, assimilate_inertial, innovate_inertial
from simnav.estimators.models.propagation import correct_inertial, propagate_inertial
from simnav.kernel_types import FlagMatrix, IntegerMatrix, IntegerVector, Matrix, Vector
from simnav.types import Array, Flags, Integers

from .adkf import adkf_noise
from .correntropy import correntropy_rule
from .fading import fading_noise
from .gating import gate_noise
from .innovation_based import innovation_noise
from .noise import INFLATION, REJECT, TIME, NoiseAdaptation, copied
from .prediction import (
    BLAMED,
    HAS_PASSED,
    IS_DISTURBED,
    IS_WRONG,
    PredictionTest,
    joint_inflation,
    judge_prediction,
)
from .robust import huber_noise, igg3_noise
from .sage_husa import sage_husa_noise
from .student_t import student_t_noise
from .variational_bayes import variational_bayes_noise

__all__ = ["RULES", "adapt_inertial", "mixture_rule", "step_rule"]

#: The rules, in the order of the numbers by which a kernel knows them.
RULES = (
    innovation_noise, sage_husa_noise, variational_bayes_noise, huber_noise, igg3_noise, correntropy_rule,
    student_t_noise, gate_noise, adkf_noise, fading_noise,
)  # fmt: skip
#: Those before this one are estimates; with a poor prediction the noise used last stands.
WEIGHTS = 3
#: The number of a mixture of levels, which has an update of its own.
MIXTURE = len(RULES)
#: What an inflation is of: position, velocity and attitude (`inflate_motion`), whose places follow, or all of P.
NOTHING, MOTION, ALL = range(3)
PLACES = (0, 6, 6, 9)
#: What is known of the instruments of a filter of n states, row by row: number of the rule, and what an inflation is
#: of; index of each among all instruments of the run, and whether its noise is chosen (i, 2); the noise used last
#: (i, 9), and the variances at the start (n,); settings (k, p), memories of all one after the other, and their first
#: elements (k + 1,), and what is shared (`simnav.estimators.adaptations.noise.RULE`); and of the test of the
#: prediction, whether it is made, and its settings, instruments, memory and inflations
#: (`simnav.estimators.adaptations.prediction`).
Rule: TypeAlias = tuple[int, int, Integers, Array, Array, Array, Array, Integers, Array]
Test: TypeAlias = tuple[bool, Array, tuple[Integers, Array, Flags], Array, Array]


@helper
def _choose(
    row: int, rule: Rule, time: float, innovation: Array, predicted: Array, nominal: Array, used: Array
) -> float:
    """Write the noise of a measurement into ``used``; what the rule reports, 0 if it was not asked."""
    code, _, table, last, _, settings, memories, first, shared = rule
    m, i = innovation.size, table[row, 0]
    shared[TIME], shared[INFLATION], shared[REJECT] = time, 1.0, 0.0
    if table[row, 1] == 0:
        return 0.0
    before, trace = 0.0, 0.0
    for a in range(m):
        before += last[row, a * (m + 1)] if last[row, 0] > 0.0 else nominal[a, a]
        trace += predicted[a, a]
    if trace > before and code < WEIGHTS:
        for a in range(m * m):
            used[a // m, a % m] = last[row, a] if last[row, 0] > 0.0 else nominal[a // m, a % m]
        return 0.0
    own, memory = settings[i], memories[first[i] : first[i + 1]]
    if code == 0:
        return innovation_noise(own, memory, shared, innovation, predicted, nominal, used)
    if code == 1:
        return sage_husa_noise(own, memory, shared, innovation, predicted, nominal, used)
    if code == 2:
        return variational_bayes_noise(own, memory, shared, innovation, predicted, nominal, used)
    if code == 3:
        return huber_noise(own, memory, shared, innovation, predicted, nominal, used)
    if code == 4:
        return igg3_noise(own, memory, shared, innovation, predicted, nominal, used)
    if code == 5:
        return correntropy_rule(own, memory, shared, innovation, predicted, nominal, used)
    if code == 6:
        return student_t_noise(own, memory, shared, innovation, predicted, nominal, used)
    if code == 7:
        return gate_noise(own, memory, shared, innovation, predicted, nominal, used)
    if code == 8:
        return adkf_noise(own, memory, shared, innovation, predicted, nominal, used)
    return fading_noise(own, memory, shared, innovation, predicted, nominal, used)


@kernel
def adapt_inertial(
    state: tuple[Vector, Vector, Matrix, Vector, Vector, Vector, Vector],
    samples: tuple[Vector, Vector, Matrix, Matrix],
    start: int,
    until: float,
    noise: Vector,
    matrices: tuple[Matrix, Matrix, Matrix],
    others: tuple[Vector, Vector, Vector, Vector],
    packet: tuple[tuple[IntegerMatrix, Matrix, Matrix], tuple[IntegerVector, Vector, Matrix, Matrix]],
    choice: tuple[
        tuple[int, int, IntegerMatrix, Matrix, Vector, Matrix, Vector, IntegerVector, Vector],
        tuple[bool, Vector, tuple[IntegerMatrix, Vector, FlagMatrix], Matrix, Vector],
    ],
) -> int:
    """Do what `simnav.estimators.models.inertial_step.filter_inertial` does, with a noise that a rule chooses.

    Parameters
    ----------
    state, samples, start, until, noise, matrices, others, packet
        As of `filter_inertial`; ``start`` is its ``first``.
    choice : tuple of tuples
        The rule, and the test of the prediction, see `Rule`.

    Returns
    -------
    int
        Index of the first sample that is not completely used.
    """
    (codes, arms, noises), (which, times, values, results) = packet
    (code, inflates, table, last, variances, settings, memories, first, shared), test = choice
    tests, limits, known, memory, kept = test
    position, velocity, dcm, _, bias, _, clock = state
    calibration, rate, density, correction = others
    calibrated, covariance = (calibration, rate, density), matrices[2]
    now, n = (position, velocity, dcm, clock[12:15], bias, calibration), covariance.shape[0]
    for k in range(which.size + 1):
        time = min(times[k], until) if k < which.size else until
        if time > clock[0]:
            start = propagate_inertial(state, samples, start, time, noise, matrices, calibrated, time - clock[0])
        if k == which.size:
            break
        row, result = which[k], results[k]
        i, d = table[row, 0], codes[row, 1]
        aid, value = (codes[row, 0], arms[row], codes[row, 2], codes[row, 3]), values[k, :d]
        nominal = noises[row, : d * d].reshape((d, d))
        innovation, cross, predicted, used = np.empty(d), np.empty((n, d)), np.empty((d, d)), np.empty((d, d))
        for a in range(RESULTS):
            result[a] = 0.0
        result[NIS], result[SIGMA], result[SIZE] = -1.0, nan, nan
        if not innovate_inertial(aid, value, now, covariance, innovation, cross, predicted):
            continue
        noisy, said, inflation = True, 0, 1.0
        for a in range(d):
            noisy = noisy and nominal[a, a] > 0.0
            result[INNOVATION + a] = innovation[a]
        if d == 1:
            result[SIZE] = abs(innovation[0])
        if tests and (noisy or code == MIXTURE):
            said = judge_prediction(innovation, predicted, nominal, i, times[k], limits, known, memory)
        if code == MIXTURE:
            if said & IS_WRONG:
                result[NIS], result[SIZE] = assimilate_inertial(aid, value, now, covariance, nominal, correction)
                continue
            probability, count = memories[first[i] : first[i + 1]], first[i + 1] - first[i]
            levels, transition = settings[i, :count], settings[i, count:].reshape((count, count))
            result[NIS], expected = mixture_update(
                covariance, cross, predicted, nominal, innovation, levels, transition, probability, correction
            )
            if result[NIS] >= 0.0:
                correct_inertial(position, velocity, dcm, bias, calibration, correction)
                result[REPORT] = probability[0]
                for a in range(d):
                    result[SIGMA + a] = sqrt(expected * nominal[a, a])
            continue
        copied(nominal, used)
        if noisy:
            if said & HAS_PASSED:
                kept[BLAMED] = 0.0
            if said & IS_WRONG == 0:
                result[REPORT] = _choose(row, choice[0], times[k], innovation, predicted, nominal, used)
                inflation = shared[INFLATION]
                if shared[REJECT] > 0.0:
                    result[NIS] = REJECTED
                    continue
            elif said & IS_DISTURBED and inflates != NOTHING:
                inflation = joint_inflation(innovation, predicted, nominal, covariance, limits, kept)
            for a in range(d * d):
                last[row, a] = used[a // d, a % d]
            for a in range(d):
                result[SIGMA + a] = sqrt(used[a, a])
        if inflation != 1.0 and inflates == ALL:
            for a in range(n):
                for b in range(n):
                    covariance[a, b] *= inflation
                for b in range(d):
                    cross[a, b] *= inflation
            for a in range(d):
                for b in range(d):
                    predicted[a, b] *= inflation
        elif inflation != 1.0:
            inflate_motion(covariance, inflation, variances, PLACES)
            innovate_inertial(aid, value, now, covariance, innovation, cross, predicted)
        result[NIS] = absorb_inertial(covariance, cross, predicted, used, innovation, now, correction)
    return start


def step_rule(adaptation: NoiseAdaptation, names: Sequence[str], variances: Array) -> StepRule | None:
    """The rule of an adaptation for a step of a filter, or None if the adaptation has no kernel.

    Parameters
    ----------
    adaptation : NoiseAdaptation
        Begun for the run; a step changes its memory.
    names : sequence of str
        The instruments of the filter.
    variances : (n,) array
        Variances of its state at the start of the run.
    """
    if not adaptation.ruled or adaptation.rule not in RULES or adaptation.inflates_position:
        return None
    inflates = ALL if adaptation.inflates else MOTION if adaptation.inflates_motion else NOTHING
    chosen = [adaptation.in_scope(adaptation.instruments[name].kind) for name in names]
    indices = [adaptation.index[name] for name in names]
    rule = (
        RULES.index(adaptation.rule), inflates, np.array([indices, chosen], np.int64).T.copy(),
        np.zeros((len(names), 9)), variances, adaptation.rule_settings, adaptation.rule_memory, adaptation.rule_first,
        adaptation.rule_shared,
    )  # fmt: skip
    return StepRule(adapt_inertial, names, ((rule, adaptation.prediction.arrays(len(variances))),))


def mixture_rule(
    levels: Array,
    transition: Array,
    probability: Array,
    names: Sequence[str],
    prediction: PredictionTest,
    variances: Array,
) -> StepRule:
    """The rule of a mixture of noise levels (`simnav.estimators.algebra.mixture.mixture_update`).

    Parameters
    ----------
    levels, transition : (j,) and (j, j) arrays
        Variances of the levels, as multiples of the nominal ones, and probabilities of the transitions between them.
    probability : (i, j) array
        Probability of each level for each instrument of the run; a step changes it.
    names : sequence of str
        The instruments of the filter.
    prediction : PredictionTest
        The test of the prediction, which knows all i instruments of the run.
    variances : (n,) array
        As of `step_rule`.
    """
    count = len(levels)
    indices = [prediction.index[name] for name in names]
    rule = (
        MIXTURE, NOTHING, np.array([indices, [1] * len(names)], np.int64).T.copy(), np.zeros((len(names), 9)),
        variances, np.tile([*levels, *transition.ravel()], (len(probability), 1)), probability.ravel(),
        np.arange(0, probability.size + 1, count), np.empty(0),
    )  # fmt: skip
    return StepRule(adapt_inertial, names, ((rule, prediction.arrays(len(variances))),))
