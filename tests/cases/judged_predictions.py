"""The tests of the prediction (`simnav.estimators.adaptations.prediction`), innovation by innovation."""

from __future__ import annotations

from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.adaptations.prediction import PredictionTest, judge_prediction
from simnav.types import Instruments

__all__ = ["JudgedPredictions"]


class JudgedPredictions:
    """The tests over the instruments of a run; the parameters are those of `PredictionTest`."""

    def __init__(self, instruments: Instruments, together: int = 3):
        self._names, self._tested = list(instruments), PredictionTest(instruments, together).record(0)

    def fails(self, innovation: Innovation) -> bool:
        """Whether the prediction of an innovation is taken as wrong."""
        m, tested = innovation.measurement, self._tested
        if not tested.tests:
            return False
        row = self._names.index(m.instrument)
        own = innovation.residual, innovation.predicted, innovation.noise
        return bool(judge_prediction(*own, row, m.time, m.value, tested).wrong)
