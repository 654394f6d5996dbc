"""A Kalman filter that is told a predicted velocity while its DVL gives none.

The prediction (`simnav.estimators.networks.velocity`) is one more instrument of the filter, a DVL without errors but
for its noise, at the place of the real one. Its reading states its own sigma, which the network says. Errors of
neighbouring predictions are nearly the same, so that those of a while have the information of one: the variance is
that of the network times the number of predictions in this while. What the prediction and the filter both know from the
IMU is counted twice; the large variance keeps that small.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from simnav.estimator import UnsuitableScenario
from simnav.estimator.needs import IMU, Needs
from simnav.estimators.models.suitable import ModelChoice
from simnav.estimators.networks.file import NetworkPiece
from simnav.estimators.networks.velocity import (
    PERIOD,
    RECIPE,
    VELOCITIES,
    VERSION,
    VelocityNetwork,
    VelocitySeconds,
    shapes_of,
)
from simnav.types import Datasheet, Estimate, InitialState, Instruments, Measurement, Measurements

from .iterated import Iteration
from .kalman import KalmanEstimator

__all__ = ["MissingVelocityEstimator", "PredictedVelocity"]


class PredictedVelocity(NetworkPiece):
    """The velocity of a network while the DVL gives none.

    Parameters
    ----------
    file : str
        Network of the recipe `simnav.estimators.training.velocity_network`; empty: the one of ``budget``.
    budget : int
        Budget of training voyages of a network that comes with simnav: 1000 or 20000.
    lasting : float
        Time for which the error of a prediction is the same [s].

    Raises
    ------
    NetworkError
        If the file cannot be used.
    ValueError
        If the time is not positive, or no network of this budget comes with simnav.
    """

    def __init__(self, file: str = "", lasting: float = 10.0, budget: int = 1000):
        if not lasting > 0.0:
            raise ValueError(f"lasting = {lasting:g}: it must be positive")
        self.network = self.chosen(file, budget, RECIPE, VERSION, shapes_of)
        self.lasting = lasting

    def begin(self, sheet: Datasheet, start: InitialState, name: str) -> None:
        """Begin a run with a DVL; its predictions have the name of an instrument."""
        self._seconds, self._asked, self._name = VelocitySeconds(sheet, start), VelocityNetwork(self.network), name

    def predict(self, measurements: Measurements) -> Measurement | None:
        """The prediction at the end of a step, if readings are missing."""
        inputs = self._seconds.take(measurements)
        if inputs is None:
            return None
        difference, sigma = self._asked.advance(inputs)
        if not self._seconds.is_missing:
            return None
        speed, count = self._seconds.speed, max(self.lasting / max(PERIOD, measurements.time - measurements.start), 1.0)
        value = self._seconds.held + speed * difference
        return Measurement(measurements.time, self._name, "dvl", value, "", speed * sigma * np.sqrt(count))


class MissingVelocityEstimator(KalmanEstimator):
    """The filter of the module.

    Parameters
    ----------
    model : ErrorModel or ModelChoice
        As of `KalmanEstimator`.
    velocity : PredictedVelocity
        The predictions.
    iteration : Iteration, optional
        As of `KalmanEstimator`.
    """

    pieces: ClassVar[tuple[str, ...]] = ("model", "velocity", "iteration")
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses, "adaptation": "a prediction is not a reading, of which it could judge the noise",
        "smoother": "the predictions of a while have one error, which a smoother would take for many",
    }  # fmt: skip

    def __init__(self, model: ModelChoice, velocity: PredictedVelocity, iteration: Iteration | None = None):
        super().__init__(model, iteration=iteration)
        self.velocity = velocity

    @property
    def needs(self) -> Needs:
        """An IMU and a DVL, and what the model needs."""
        return (*super().needs, IMU, VELOCITIES)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario without a DVL."""
        sheet = VelocityNetwork.dvl_of(instruments)
        if sheet is None:
            raise UnsuitableScenario(f"{self.label}: it needs one of {', '.join(VELOCITIES)}; there is none")
        name = f"{sheet.name} predicted"
        zero = np.zeros(3)
        own = replace(
            sheet, name=name, kind="dvl", bias=zero, bias_instability=zero, scale=0.0, misalignment=zero, details={},
            blocks=(), processes=(), timing=None, sources=(), stated=True,
        )  # fmt: skip
        self.velocity.begin(sheet, start, name)
        super().reset(start, Instruments([*instruments.values(), own], instruments.imu, instruments.step))

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, and the prediction at its end if the DVL gave none."""
        predicted = self.velocity.predict(measurements)
        if predicted is not None:
            measurements = replace(measurements, aids=[*measurements.aids, predicted])
        return super().update(measurements)
