"""A Kalman filter that keeps its innovations: what a maximum-likelihood fit of datasheets needs.

The innovation v of a reading has the covariance S, if the datasheets are true, and is independent of all before. So the
logarithm of the likelihood of a run is, without constants ::

    log L = -1/2 sum (v' S^-1 v + log det S)

(R. L. Kashyap, "Maximum likelihood identification of stochastic linear systems", IEEE TAC 15(1), 1970).
"""

from __future__ import annotations

from typing import NamedTuple

from simnav.estimators.adaptations.choice import Choice
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.types import Array, InitialState, Instruments

from .kalman import FilterFunctions, KalmanEstimator

__all__ = ["InnovationKeeper", "KeptInnovation"]


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
        """Those of the filter, but `correct`, which keeps the innovation."""
        return super().functions().replaced(correct=self.correct)

    def correct(self, dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
        """Correct covariance and correction, and keep the innovation."""
        spread = prediction.predicted + prediction.noise
        nis = super().correct(dynamics, choice, readings, k, prediction)
        if nis >= 0.0:
            m = self._measurements[k]
            self.kept.append(KeptInnovation(m.instrument, m.time, prediction.innovation.copy(), spread))
        return nis
