"""The linear error-state Kalman filter: open loop (feed-forward), or closed loop with feedback at an interval.

In open loop the error is estimated, and never fed back; all that follows is about it. In closed loop
(``feedback``) the estimated error is taken off the nominal trajectory at this interval, and is zero afterwards, so the
nominal trajectory stays near the true one.

The nominal trajectory is free inertial navigation from the initial state. The filter estimates its error with F and H
taken along the nominal trajectory, and the estimate is nominal minus error. It is linear: with the nominal trajectory
given, the estimate is a linear function of the measurements. With x the correction (what is to be added to the nominal
state, minus the error), r the measurement minus what the nominal state predicts:

- ``x- = Phi x+``; ``x+ = x- + K (r - H x-)``; P as in the EKF

It holds as long as the nominal error stays in the linear range. Free inertial navigation leaves it sooner or later:
level errors oscillate with Schuler's period (84 min), and height runs away by a factor of e in 9.5 minutes
(``sqrt(R / 2 g)``). What is lost then is of second order in the error, and the covariance does not know: attitude error
times velocity error in a DVL's axes, its scale error times velocity error, ``d^2 / 2R`` in the height for a position
off by d. Measured (errors of one seed, ANEES over 50):

- open-sea, tactical IMU (1 deg/h, 200 ug): nominal off by 0.2 km after 225 s and 6.8 km after 900 s; horizontal RMSE
  0.6 m (EKF 0.3 m). Velocity ANEES 1.6 in the first 120 s, but within its band when aligned to 0.05 deg and with
  accelerometers of 20 ug.
- uuv-surface without its faults (0.01 deg/h, 1000 ug, DVL scale 2.55 %): velocity ANEES above 5 after 100 s.
- harbour-multipath, MEMS: nominal off by 55 km after 900 s; heading RMSE 4.3 deg (EKF 2.3 deg).
- coastal-voyage, 100 min: the nominal height has run away, and so has the estimate (more than 100 km off) after 75 min.

The nominal's error is the diagnostic ``nominal_error`` [m].

Source: P. S. Maybeck, *Stochastic Models, Estimation, and Control*, vol. 1, 1979, section 6.3 (feed-forward and
feedback configurations); P. D. Groves 2013, section 14.1.1 (open loop).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.propagation import Samples
from simnav.estimators.models.suitable import ModelChoice
from simnav.types import Estimate, InitialState, Instruments, Measurements

from .kalman import FilterFunctions, KalmanEstimator

__all__ = ["LinearKalmanEstimator"]

_ROUNDING = 1e-6  # of times [s]


class LinearKalmanEstimator(KalmanEstimator):
    """The solver of the module, over any model that can propagate an error.

    Parameters
    ----------
    model, adaptation
        Model and adaptation of the filter, as for `KalmanEstimator`.
    feedback : float
        Interval after which the estimated error is fed back into the nominal trajectory [s]; 0: never (open loop).

    Attributes
    ----------
    x : (n,) array
        The correction: minus the estimated error of the model's state.
    """

    pieces = ("model", "adaptation")
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses,
        "iteration": "it linearises about the nominal trajectory, which no measurement moves",
        "smoother": "its corrections stay outside of the state that a smoother goes back over",
    }

    def __init__(self, model: ModelChoice, adaptation: Adaptation | None = None, feedback: float = 0.0):
        if not feedback >= 0.0:
            raise ValueError(f"feedback is {feedback:g}; it must be an interval in s, or 0 for none")
        super().__init__(model, adaptation)
        self.feedback = feedback

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        super().reset(start, instruments)
        self.x = np.zeros(self.model.size)
        self._fed_back = start.time

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        estimate = super().update(measurements)
        estimate.diagnostics = {**estimate.diagnostics, "nominal_error": float(np.linalg.norm(self.x[:3]))}
        if self.feedback > 0.0 and self.model.time - self._fed_back >= self.feedback - _ROUNDING:
            self.model.correct(self.x)
            self.x[:] = 0.0
            self._fed_back = self.model.time
        return estimate

    def functions(self) -> FilterFunctions:
        """Motion, prediction and correction keep the estimated error apart from the nominal state."""
        return super().functions().replaced(propagate=self.propagate, predict=self.predict, retract=self.retract)

    def propagate(self, dynamics: Dynamics, samples: Samples, until: float) -> None:
        """Advance the nominal state, the covariance and the estimated error."""
        elapsed = until - self.model.time
        if elapsed > 0.0:
            self.model.propagate(self.covariance, until)
            self.model.carry(self.x, elapsed)

    def predict(self, dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
        """Compare a measurement with the nominal state less its estimated error."""
        if not super().predict(dynamics, readings, k, prediction):
            return False
        assert self._linearised is not None
        prediction.innovation[:] -= self._linearised.jacobian @ self.x
        return True

    def retract(self, dynamics: Dynamics) -> None:
        """Add the correction to the estimated error."""
        self.x += dynamics.correction

    def _estimate(self) -> Estimate:
        nominal = self.model.snapshot()
        self.model.correct(self.x)
        estimate = self.model.estimate(self.covariance)
        self.model.restore(nominal)
        return estimate
