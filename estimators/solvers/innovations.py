"""A Kalman filter that keeps its innovations: what a maximum-likelihood fit of datasheets needs.

The innovation v of a reading has the covariance S, if the datasheets are true, and is independent of all before. So the
logarithm of the likelihood of a run is, without constants ::

    log L = -1/2 sum (v' S^-1 v + log det S)

(R. L. Kashyap, "Maximum likelihood identification of stochastic linear systems", IEEE TAC 15(1), 1970).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.choice import Choice
from simnav.estimators.algebra.joseph import joseph_update
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.propagation import Samples
from simnav.kinds import MOST_COMPONENTS
from simnav.structures import length, structure
from simnav.types import Array, InitialState, Instruments, Measurement

from .kalman import FilterFunctions, KalmanEstimator

__all__ = ["InnovationKeeper", "KeptInnovation", "correct_and_keep"]

#: Readings that a call of the loop uses at most.
_READINGS = 512
#: What is kept of each: its components (0: it was not used), its innovation, and the covariance of that.
KEPT = structure(components=int, innovation=MOST_COMPONENTS, covariance=(MOST_COMPONENTS, MOST_COMPONENTS))


class KeptInnovation(NamedTuple):
    """The innovation of a reading that was used.

    Attributes
    ----------
    instrument : str
        Its instrument; of one with channels ``INSTRUMENT:CHANNEL``.
    time : float
        Time of the reading [s].
    value : (d,) array
        The innovation v, units of the reading's error.
    covariance : (d, d) array
        Its covariance S by the filter.
    """

    instrument: str
    time: float
    value: Array
    covariance: Array


@kernel(passed=True)
def correct_and_keep(dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
    """As `simnav.estimators.solvers.filter_step.correct`; the innovation goes to row k of ``choice.last``."""
    d, kept = prediction.innovation.size, choice.last[k].view(KEPT)[0]
    spread = np.empty((d, d))
    for a in range(d):
        for b in range(d):
            spread[a, b] = kept.covariance[a, b] = prediction.predicted[a, b] + prediction.noise[a, b]
        kept.innovation[a] = prediction.innovation[a]
    nis = joseph_update(dynamics.covariance, prediction.cross, spread, prediction.innovation, dynamics.correction)
    kept.components = d if nis >= 0.0 else 0
    return nis


class InnovationKeeper(KalmanEstimator):
    """The plain filter of a model, which keeps the innovation of every reading that it used.

    Attributes
    ----------
    kept : list of KeptInnovation
        Since `reset`, in the order of use.
    """

    kept: list[KeptInnovation]

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        self.kept = []
        super().reset(start, instruments)

    def functions(self) -> FilterFunctions:
        """Those of the filter, but the one that corrects."""
        return super().functions().replaced(correct=correct_and_keep)

    def noise_choice(self, instruments: Instruments) -> Choice:
        """That of a filter without an adaptation, with room for innovations."""
        self._room = np.zeros((_READINGS, length(KEPT)))
        return replace(super().noise_choice(instruments), last=self._room)

    def _use(
        self,
        measurements: Sequence[Measurement],
        samples: Samples,
        until: float,
        flagged: list[tuple[str, float]],
    ) -> None:
        """Use measurements as the filter does, as many at once as there is room for, and keep the innovations."""
        for first in range(0, max(len(measurements), 1), _READINGS):
            part = measurements[first : first + _READINGS]
            last = first + _READINGS >= len(measurements)
            room = self._room.view(KEPT)[:, 0]
            room["components"] = 0
            super()._use(part, samples, until if last else min(part[-1].time, until), flagged)
            for m, kept in zip(part, room, strict=False):
                if d := int(kept["components"]):
                    innovation, covariance = kept["innovation"][:d].copy(), kept["covariance"][:d, :d].copy()
                    self.kept.append(KeptInnovation(m.instrument, m.time, innovation, covariance))
