"""The invariant extended Kalman filter on SE_2(3) with biases, on the rotating Earth.

Attitude C, velocity v and position p are one element X of the group SE_2(3) of double direct isometries, and its error
is not a difference. With the truth X, the estimate Y and the 9 components xi = (phi, nu, rho) of the error:

- left-invariant ``X^-1 Y = exp(xi)``: the differences of v and p in body axes. GNSS position and velocity,
  terrain fix and depth (``y = X d`` with a known vector d) are invariant measurements: their Jacobian in body axes is
  constant.
- right-invariant ``Y X^-1 = exp(xi)``: the differences after the correction of the attitude error. DVL (``y = X^-1 d``)
  is an invariant measurement, and so is a heading or another known direction that is measured in body axes.

Biases and calibration states have plain differences (Barrau's "imperfect" filter).

**How it is computed.** The covariance P stays that of the public error (differences in north-east-down and rotation
vector), so that nothing is to be converted. To first order xi is ``T(Y)`` times the public error, with an invertible
T. The linearised propagation and the gain are the same in any coordinates. Two things are not:

- the correction is the group's exponential: with (dp, dv, dphi) of the public error and the left Jacobian J of SO(3)
  ``C+ = exp(dphi x) C``, ``v+ = v + J dv``, ``p+ = p + J dp``, the same for both errors;
- the filter holds the covariance of xi, not of the public error, through the correction: ``P+ = N P N'`` with
  ``N = T(Y+)^-1 T(Y)``. Left: T turns into the body, so N turns position, velocity and attitude by ``exp(dphi x)``.
  Right: ``xi = (phi, dv + v x phi, dp + p x phi)``, so ``N = I`` but ``dv <- dv - (v+ - v) x phi``, likewise dp.
  Only the change of p enters: the origin does not matter.

So the covariance is still correct after the correction of a large heading error, and the filter converges from initial
headings from which the EKF does not.

**How far the theory goes.** Log-linear error propagation needs group-affine dynamics: exact for a flat Earth that does
not turn and known biases. Coriolis, transport rate, gravity's change with place, and the biases break it; they are in
the linearised propagation to first order, as in the EKF. Guaranteed is what is guaranteed for any EKF.

Source: A. Barrau and S. Bonnabel, *The invariant extended Kalman filter as a stable observer*, IEEE TAC 62(4), 2017,
sections II-IV; biases: A. Barrau, thesis, 2015, chapter 4; rotating Earth: M. Brossard, A. Barrau, P. Chauchat, S.
Bonnabel, *Associating uncertainty to extended poses for on Lie group IMU preintegration with rotating Earth*, IEEE T-RO
38(2), 2022.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.models.filtering import Dynamics
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_errors import PART
from simnav.geometry.rotation import left_jacobian, skew

from .kalman import FilterFunctions, KalmanEstimator

__all__ = ["InvariantKalmanEstimator"]

_IDENTITY = np.eye(3)


class InvariantKalmanEstimator(KalmanEstimator):
    """The solver of the module.

    Parameters
    ----------
    model : InertialModel
        The model; position, velocity and attitude are the first nine components of its error.
    adaptation : Adaptation, optional
        Chooses the noise of each measurement; default: the datasheet's.
    error : "left" or "right"
        The invariant error: the left- or the right-invariant one.
    """

    pieces = ("model", "adaptation")
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses,
        "iteration": "an iterated correction is not one on the group",
        "smoother": "it turns the covariance after a correction, which a smoother does not undo",
    }

    @classmethod
    def misfit(cls, keyword: str, made: type) -> str:
        """Why it cannot work with a piece of a class: its group is that of an inertial model."""
        if keyword == "model" and not issubclass(made, InertialModel):
            return (
                "its group has position, velocity and attitude: the first nine components of an InertialModel's error"
            )
        return super().misfit(keyword, made)

    def __init__(
        self, model: InertialModel, adaptation: Adaptation | None = None, error: Literal["left", "right"] = "left"
    ):
        super().__init__(model, adaptation)
        if error not in ("left", "right"):
            raise ValueError(f'error is {error!r}; it must be "left" or "right"')
        self.error = error

    def functions(self) -> FilterFunctions:
        """The state is corrected on the group."""
        return super().functions().replaced(retract=self.retract)

    def retract(self, dynamics: Dynamics) -> None:
        """Correct the state on the group, and transform the covariance of the invariant error."""
        dx = dynamics.correction
        turn, P, navigation = dx[PART.attitude], self.covariance, PART.navigation
        J, across = left_jacobian(turn), skew(turn)
        dx[PART.position], dx[PART.velocity] = J @ dx[PART.position], J @ dx[PART.velocity]
        self.model.correct(dx)
        if self.error == "left":
            N, rotation = np.zeros((navigation.stop, navigation.stop)), _IDENTITY + across @ J  # exp(turn x)
            for part in (PART.position, PART.velocity, PART.attitude):
                N[part, part] = rotation
            P[navigation] = N @ P[navigation]
            P[:, navigation] = P[:, navigation] @ N.T
        else:
            shift = np.concatenate([skew(dx[PART.position]), skew(dx[PART.velocity])])
            P[PART.motion] -= shift @ P[PART.attitude]
            P[:, PART.motion] -= P[:, PART.attitude] @ shift.T
