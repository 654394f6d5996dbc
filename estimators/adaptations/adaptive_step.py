"""All measurements of a step of the inertial filter in one kernel, with a noise that is chosen by each innovation.

For the rules of `RULES`. Each is a kernel of its adaptation, which also calls it by itself, so that a filter has the
same noise measurement by measurement.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, sqrt
from typing import TypeAlias

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.models.base import INNOVATION, NIS, REPORT, RESULTS, SIGMA, StepRule
from simnav.estimators.models.inertial_step import STEP, AidTable, Measured
from simnav.estimators.models.inertial_update import absorb_inertial, innovate_inertial
from simnav.estimators.models.propagation import Moving, Samples, propagate_inertial
from simnav.types import Array, Flags, Integers

from .correntropy import correntropy_rule
from .innovation_based import innovation_noise
from .noise import EstimatedNoise, NoiseAdaptation, copied
from .prediction import IS_WRONG, judge_prediction
from .robust import huber_noise, igg3_noise
from .sage_husa import sage_husa_noise
from .student_t import student_t_noise
from .variational_bayes import variational_bayes_noise

__all__ = ["RULES", "CompiledRules", "adapt_inertial"]

#: The rules, in the order of the numbers by which a kernel knows them.
RULES = (
    innovation_noise, sage_husa_noise, variational_bayes_noise, huber_noise, igg3_noise, correntropy_rule,
    student_t_noise,
)  # fmt: skip
#: Those before this one are estimates; with a poor prediction the noise used last stands.
WEIGHTS = 3
#: What is known of the instruments of a filter, row by row: number of the rule; index of each among all instruments of
#: the run (i,), whether its noise is estimated (i,), the noise used last (i, 9); settings (k, p), first elements of the
#: memories (k + 1,) and memories of all of them; and of the test of the prediction, whether it is made, and its
#: settings, instruments and memory (`simnav.estimators.adaptations.prediction`).
Rule: TypeAlias = tuple[int, Integers, Flags, Array, Array, Integers, Array]
Test: TypeAlias = tuple[bool, Array, tuple[Integers, Array, Flags], Array]


@kernel()
def _choose(i: int, row: int, rule: Rule, innovation: Array, predicted: Array, nominal: Array, used: Array) -> float:
    """Write the noise of a measurement into ``used``; what the rule reports, 0 if it was not asked."""
    code, _, estimated, last, settings, first, memory = rule
    m = innovation.size
    copied(nominal, used)
    if not estimated[row]:
        return 0.0
    before, trace = 0.0, 0.0
    for a in range(m):
        before += last[row, a * (m + 1)] if last[row, 0] > 0.0 else nominal[a, a]
        trace += predicted[a, a]
    if trace > before and code < WEIGHTS:
        for a in range(m * m):
            used[a // m, a % m] = last[row, a] if last[row, 0] > 0.0 else nominal[a // m, a % m]
        return 0.0
    own = memory[first[i] : first[i + 1]]
    if code == 0:
        return innovation_noise(settings[i], own, innovation, predicted, nominal, used)
    if code == 1:
        return sage_husa_noise(settings[i], own, innovation, predicted, nominal, used)
    if code == 2:
        return variational_bayes_noise(settings[i], own, innovation, predicted, nominal, used)
    if code == 3:
        return huber_noise(settings[i], own, innovation, predicted, nominal, used)
    if code == 4:
        return igg3_noise(settings[i], own, innovation, predicted, nominal, used)
    if code == 5:
        return correntropy_rule(settings[i], own, innovation, predicted, nominal, used)
    return student_t_noise(settings[i], own, innovation, predicted, nominal, used)


@kernel(
    f"i8({STEP}, Tuple((Tuple((i8, i8[::1], b1[::1], f8[:, ::1], f8[:, ::1], i8[::1], f8[::1])), "
    "Tuple((b1, f8[::1], Tuple((i8[:, ::1], f8[::1], b1[:, ::1])), f8[:, ::1])))))"
)
def adapt_inertial(
    state: Moving, samples: Samples, start: int, until: float, noise: Array, matrices: tuple[Array, Array, Array],
    others: tuple[Array, Array, Array, Array], packet: tuple[AidTable, Measured], choice: tuple[Rule, Test],
) -> int:  # fmt: skip
    """Do what `simnav.estimators.models.inertial_step.filter_inertial` does, with an estimated noise.

    Parameters
    ----------
    state, samples, start, until, noise, matrices, others, packet
        As of `filter_inertial`; ``start`` is its ``first``. A row of results is that of `StepRule`.
    choice : tuple of tuples
        The rule, and the test of the prediction, see `Rule`.

    Returns
    -------
    int
        Index of the first sample that is not completely used.
    """
    (codes, arms, noises), (which, times, values, results) = packet
    rule, test = choice
    position, velocity, dcm, _, bias, _, clock = state
    calibration, rate, density, correction = others
    calibrated, covariance = (calibration, rate, density), matrices[2]
    now = position, velocity, dcm, clock[12:15], bias, calibration
    index, last = rule[1], rule[3]
    tests, settings, known, memory = test
    for k in range(which.size + 1):
        time = min(times[k], until) if k < which.size else until
        if time > clock[0]:
            start = propagate_inertial(state, samples, start, time, noise, matrices, calibrated, time - clock[0])
        if k == which.size:
            break
        row = which[k]
        code, d, bias_at, scale_at = codes[row, 0], codes[row, 1], codes[row, 2], codes[row, 3]
        innovation, cross, predicted = np.empty(d), np.empty((covariance.shape[0], d)), np.empty((d, d))
        nominal, used, result = noises[row, : d * d].reshape((d, d)), np.empty((d, d)), results[k]
        for a in range(RESULTS):
            result[a] = 0.0
        result[NIS], result[SIGMA] = -1.0, nan
        if not innovate_inertial(
            (code, arms[row], bias_at, scale_at), values[k, :d], now, covariance, innovation, cross, predicted
        ):
            continue
        noisy = True
        for a in range(d):
            noisy = noisy and nominal[a, a] > 0.0
        i = index[row]
        copied(nominal, used)
        if noisy:
            said = (
                judge_prediction(innovation, predicted, nominal, i, times[k], settings, known, memory) if tests else 0
            )
            if said & IS_WRONG == 0:
                result[REPORT] = _choose(i, row, rule, innovation, predicted, nominal, used)
            for a in range(d * d):
                last[row, a] = used[a // d, a % d]
            for a in range(d):
                result[SIGMA + a] = sqrt(used[a, a])
        for a in range(d):
            result[INNOVATION + a] = innovation[a]
        result[NIS] = absorb_inertial(covariance, cross, predicted, used, innovation, now, correction)
    return start


class CompiledRules:
    """The rules of an adaptation for the instruments of a filter (`simnav.estimators.models.base.StepRules`).

    Parameters
    ----------
    adaptation : NoiseAdaptation
        Begun for the run; a step changes its memory.
    """

    def __init__(self, adaptation: NoiseAdaptation):
        self.adaptation = adaptation

    def step_rule(self, names: Sequence[str]) -> StepRule | None:
        """The rule, or None if the adaptation has no kernel, or bounds a full matrix, which is done by NumPy."""
        own = self.adaptation
        if own.rule not in RULES or (isinstance(own, EstimatedNoise) and own.full):
            return None
        index = np.array([own.index[name] for name in names], np.int64)
        estimated = np.array([own.in_scope(own.instruments[name].kind) for name in names], bool)
        last = np.zeros((len(names), 9))
        rule = RULES.index(own.rule), index, estimated, last, own.rule_settings, own.rule_first, own.rule_memory
        return StepRule(adapt_inertial, ((rule, own.prediction.arrays),))
