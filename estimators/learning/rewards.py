"""The reward of a step of a filter, as one kernel for one filter or a bank of them.

============= =================================================================================================
error         ``-ln((e^2 + s^2) / (o^2 + s^2)) / 2``: e and o the horizontal errors of the filter and of the
              oracle, s the oracle's horizontal sigma
gain          ``-ln((e^2 + r^2) / (p^2 + r^2)) / 2``: p the horizontal error of the plain filter, and r^2 the mean
              of ``p^2 + s^2`` from the start of the voyage on
likelihood    logarithm of the density that the filter gave to the true horizontal position [1/m^2], but for
              the constant
labels        +1 for each fault that is found, -1 for each that is not, -1 for each false alarm
improvement   how much the error becomes less [m]; 1 m/s counts as 10 m and 1 rad as 50 m
============= =================================================================================================

"error" counts the logarithm of every error alike: to halve 20 cm is worth what it is to halve 20 m. An agent can earn
much of it where nothing is wrong, and become worse by the RMS error of the voyage, which is scored. "gain" counts an
error by its size beside what is usual in the voyage. It is relative to the plain filter in the same step, whose return
is 0, so that it varies less from voyage to voyage; no action changes what is subtracted. (On baselines that depend on
what drives an environment: Mao, Venkatakrishnan, Schwarzkopf and Alizadeh, "Variance Reduction for Reinforcement
Learning in Input-Driven Environments", 2019.)
"""

from __future__ import annotations

from math import log, sqrt

import numpy as np

from simnav.compiled import kernel
from simnav.kernel_types import FlagVector, IntegerVector, Matrix, Stack, Vector

from .bank import Steps
from .reference import Linear

__all__ = ["NEED_ORACLE", "REWARDS", "reward"]

#: Codes of the rewards (`reward`).
REWARDS = {"error": 0, "likelihood": 1, "labels": 2, "improvement": 3, "gain": 4}
#: Those for which the oracle has to come along.
NEED_ORACLE = ("error", "gain")


@kernel
def reward(
    code: int,
    steps: Steps,
    linear: Linear,
    faulty: FlagVector,
    errors: tuple[Matrix, Matrix],
    decision: tuple[IntegerVector, Stack, Matrix],
    filters: tuple[Stack, Matrix],
    rewards: Vector,
) -> None:
    """Compute the reward of each filter's step; 0 if the truth is not known.

    Parameters
    ----------
    code : int
        Code of the reward, from `REWARDS`.
    steps : Steps
        The steps.
    linear : Linear
        The events of all voyages.
    faulty : (e,) bool array
        True for each measurement that a fault affected.
    errors : (b, 9) and (b, 3) arrays
        Of the plain filter at the end of the step: estimate minus truth; of the oracle, as of
        `simnav.estimators.learning.voyage.Voyage`.
    decision : (k,) int, (b, p, k) and (b, 7) arrays
        Places of the instruments and factors on their sigmas, as of `simnav.estimators.learning.bank.take`;
        corrections north, east, down [m], the same of the velocity [m/s], heading [rad].
    filters : (b, n, n) and (b, n) arrays
        Covariances, and distances to the plain filter.
    rewards : (b,) array
        Overwritten with the rewards.
    """
    active, first, last = steps
    instrument, size = linear.instrument, linear.size
    error, oracle = errors
    place, scale, action = decision
    covariance, delta = filters
    counts = np.empty(scale.shape[1], np.int64)
    for b in range(first.size):
        rewards[b] = 0.0
        if not active[b]:
            continue
        north, east = error[b, 0] + delta[b, 0], error[b, 1] + delta[b, 1]
        value = 0.0
        if code == 0:
            square = oracle[b, 1] * oracle[b, 1]
            value = -0.5 * log((north * north + east * east + square) / (oracle[b, 0] * oracle[b, 0] + square))
        elif code == 4:
            square = oracle[b, 2] * oracle[b, 2]
            alone = error[b, 0] * error[b, 0] + error[b, 1] * error[b, 1]
            value = -0.5 * log((north * north + east * east + square) / (alone + square))
        elif code == 1:
            p, q, r = covariance[b, 0, 0], covariance[b, 0, 1], covariance[b, 1, 1]
            determinant = p * r - q * q
            square = (r * north * north - 2.0 * q * north * east + p * east * east) / determinant
            value = -0.5 * (square + log(determinant))
        elif code == 2:
            counts[:] = 0
            for e in range(first[b], last[b]):
                at = place[instrument[e]] if size[e] > 0 else -1
                if at < 0:
                    continue
                out = scale[b, at, min(counts[at], scale.shape[2] - 1)] <= 0.0
                counts[at] += 1
                if faulty[e]:
                    value += 1.0 if out else -1.0
                elif out:
                    value -= 1.0
        else:
            before, after = 0.0, 0.0
            for i in range(3):
                x, y = error[b, i], error[b, 3 + i]
                if x == x:
                    before += x * x
                    after += (x + action[b, i]) ** 2
                if y == y:
                    before += 100.0 * y * y
                    after += 100.0 * (y + action[b, 3 + i]) ** 2
            x = error[b, 8]
            if x == x:
                before += 2500.0 * x * x
                after += 2500.0 * (x + action[b, 6]) ** 2
            value = sqrt(before) - sqrt(after)
        rewards[b] = value if value == value else 0.0
