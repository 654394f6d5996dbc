"""How the failures of an instrument begin: at once, as its own errors, or little by little, as those of a prediction.

A wrong prediction is the integral of what is wrong. The bias of a gyroscope turns the heading, and the heading turns
the velocity: the innovations of a log grow through all sizes between its noise and a failure of its test. An instrument
that begins to be wrong is wrong from one reading to the next, or it repeats a reading. So the mean of the innovations
before the first failure tells the two apart.
"""

from __future__ import annotations

import numpy as np

from simnav.compiled import helper
from simnav.kernel_types import FlagVector, Matrix, Vector
from simnav.records import Record

__all__ = ["Onsets", "add_to_onset", "no_onsets"]

#: Memory of the mean before a failure, and number of passed tests before a new one [innovations].
BEFORE = 4
#: The failures began little by little if the mean before has at least this part of the first one. On 80 voyages of
#: ``training-rare-fixes`` (seeds 50000 to 50079) 0 to 0.2 do equally well, and 0.3 loses a third of the gain.
PART = 0.2


class Onsets(Record):
    """How the present failures of i instruments began.

    Attributes
    ----------
    mean : (i, 3) array
        Fading means of the components of their innovations, each divided by its sigma.
    value : (i, 3) array
        Their last readings.
    passed : (i,) array
        Number of passed tests since the last failure.
    sudden : (i,) array of bool
        Whether the failures began at once, or with a reading that repeats the one before.
    """

    mean: Matrix
    value: Matrix
    passed: Vector
    sudden: FlagVector


def no_onsets(count: int) -> Onsets:
    """The onsets of so many instruments, before their first innovations."""
    return Onsets(
        mean=np.zeros((count, 3)), value=np.full((count, 3), np.nan), passed=np.zeros(count),
        sudden=np.zeros(count, np.bool_),
    )  # fmt: skip


@helper
def add_to_onset(onsets: Onsets, i: int, u0: float, u1: float, u2: float, value: Vector, failed: bool) -> None:
    """Add an innovation of instrument i.

    Parameters
    ----------
    onsets : Onsets
        Updated.
    i : int
        The instrument.
    u0, u1, u2 : float
        Standardised components, with zeros up to three.
    value : (d,) array
        The reading.
    failed : bool
        Whether the innovation has failed its chi-square test.
    """
    mean, before = onsets.mean[i], onsets.value[i]
    repeated = True
    for a in range(value.size):
        repeated = repeated and value[a] == before[a]
        before[a] = value[a]
    if failed:
        if repeated:
            onsets.sudden[i] = True
        elif onsets.passed[i] >= BEFORE:
            along = u0 * mean[0] + u1 * mean[1] + u2 * mean[2]
            onsets.sudden[i] = along < PART * (u0 * u0 + u1 * u1 + u2 * u2)
        onsets.passed[i] = 0.0
    else:
        onsets.passed[i] += 1.0
    mean[0] += (u0 - mean[0]) / BEFORE
    mean[1] += (u1 - mean[1]) / BEFORE
    mean[2] += (u2 - mean[2]) / BEFORE
