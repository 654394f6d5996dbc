"""The reward of a step of a filter: a kernel for each reward, for one filter or a bank of them.

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

from collections.abc import Mapping
from math import log, sqrt
from typing import NamedTuple

import numpy as np

from simnav.compiled import Array, Kernel, helper, kernel
from simnav.kernel_types import FlagVector, IntegerVector, Matrix, Stack, Vector
from simnav.structures import structure

from .bank import Steps
from .reference import Linear

__all__ = ["NEED_ORACLE", "REWARDS", "StepResult"]

#: Rewards for which the oracle has to come along.
NEED_ORACLE = ("error", "gain")
#: Estimate minus truth: position and velocity north, east, down [m], [m/s]; roll, pitch, heading [rad].
ERROR = structure(position=3, velocity=3, tilt=2, heading=float)
#: Of the oracle, as of `simnav.estimators.learning.voyage.Voyage`: its horizontal error and sigma, and r of the reward
#: "gain" [m].
ORACLE = structure(error=float, sigma=float, usual=float)
#: Corrections of position [m], velocity [m/s], both north, east, down, and heading [rad].
CORRECTION = structure(position=3, velocity=3, heading=float)


class StepResult(NamedTuple):
    """The steps of b filters with n states, and what was decided before them.

    Attributes
    ----------
    steps : Steps
        The steps.
    linear : Linear
        The events of all voyages.
    faulty : (e,) bool array
        True for each measurement that a fault affected.
    error, oracle : (b, 9), (b, 3) array
        The `ERROR` of the plain filter at the end of the step, and the `ORACLE`.
    place, scale : (k,) int, (b, p, k) array
        Places of the instruments and factors on their sigmas, as of `simnav.estimators.learning.bank.take`.
    correction : (b, 7) array
        The `CORRECTION` that was decided.
    covariance, delta : (b, n, n), (b, n) array
        Covariances of the filters, and their distances to the plain filter.
    """

    steps: Steps
    linear: Linear
    faulty: FlagVector
    error: Matrix
    oracle: Matrix
    place: IntegerVector
    scale: Stack
    correction: Matrix
    covariance: Stack
    delta: Matrix


@helper
def _known(value: float) -> float:
    """A reward; 0 if the truth is not known."""
    return value if value == value else 0.0


@helper
def _horizontal(result: StepResult, b: int) -> tuple[float, float]:
    """Error of a filter, north and east [m]."""
    own, delta = result.error[b].view(ERROR)[0], result.delta
    return own.position[0] + delta[b, 0], own.position[1] + delta[b, 1]


@kernel
def error_reward(result: StepResult, rewards: Vector) -> None:
    """Overwrite the (b,) ``rewards`` with "error"."""
    for b in range(rewards.size):
        rewards[b] = 0.0
        if result.steps.active[b]:
            north, east = _horizontal(result, b)
            oracle = result.oracle[b].view(ORACLE)[0]
            square = oracle.sigma * oracle.sigma
            value = -0.5 * log((north * north + east * east + square) / (oracle.error * oracle.error + square))
            rewards[b] = _known(value)


@kernel
def gain_reward(result: StepResult, rewards: Vector) -> None:
    """Overwrite the (b,) ``rewards`` with "gain"."""
    for b in range(rewards.size):
        rewards[b] = 0.0
        if result.steps.active[b]:
            north, east = _horizontal(result, b)
            plain, usual = result.error[b].view(ERROR)[0].position, result.oracle[b].view(ORACLE)[0].usual
            square = usual * usual
            alone = plain[0] * plain[0] + plain[1] * plain[1]
            rewards[b] = _known(-0.5 * log((north * north + east * east + square) / (alone + square)))


@kernel
def likelihood_reward(result: StepResult, rewards: Vector) -> None:
    """Overwrite the (b,) ``rewards`` with "likelihood"."""
    covariance = result.covariance
    for b in range(rewards.size):
        rewards[b] = 0.0
        if result.steps.active[b]:
            north, east = _horizontal(result, b)
            p, q, r = covariance[b, 0, 0], covariance[b, 0, 1], covariance[b, 1, 1]
            determinant = p * r - q * q
            square = (r * north * north - 2.0 * q * north * east + p * east * east) / determinant
            rewards[b] = _known(-0.5 * (square + log(determinant)))


@kernel
def labels_reward(result: StepResult, rewards: Vector) -> None:
    """Overwrite the (b,) ``rewards`` with "labels"."""
    active, first, last = result.steps
    instrument, size, scale = result.linear.instrument, result.linear.size, result.scale
    counts = np.empty(scale.shape[1], np.int64)
    for b in range(rewards.size):
        rewards[b] = 0.0
        if not active[b]:
            continue
        counts[:] = 0
        for e in range(first[b], last[b]):
            at = result.place[instrument[e]] if size[e] > 0 else -1
            if at < 0:
                continue
            out = scale[b, at, min(counts[at], scale.shape[2] - 1)] <= 0.0
            counts[at] += 1
            if result.faulty[e]:
                rewards[b] += 1.0 if out else -1.0
            elif out:
                rewards[b] -= 1.0


@kernel
def improvement_reward(result: StepResult, rewards: Vector) -> None:
    """Overwrite the (b,) ``rewards`` with "improvement"."""
    for b in range(rewards.size):
        rewards[b] = 0.0
        if not result.steps.active[b]:
            continue
        own, change = result.error[b].view(ERROR)[0], result.correction[b].view(CORRECTION)[0]
        before, after = 0.0, 0.0
        for i in range(3):
            x, y = own.position[i], own.velocity[i]
            if x == x:
                before += x * x
                after += (x + change.position[i]) ** 2
            if y == y:
                before += 100.0 * y * y
                after += 100.0 * (y + change.velocity[i]) ** 2
        x = own.heading
        if x == x:
            before += 2500.0 * x * x
            after += 2500.0 * (x + change.heading) ** 2
        rewards[b] = _known(sqrt(before) - sqrt(after))


#: The rewards by name.
REWARDS: Mapping[str, Kernel[[StepResult, Array], None]] = {
    "error": error_reward,
    "likelihood": likelihood_reward,
    "labels": labels_reward,
    "improvement": improvement_reward,
    "gain": gain_reward,
}
