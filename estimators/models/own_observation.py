"""Measurement equations of kinds of instruments that are Python functions.

A kind may name one of the compiled equations (`simnav.kinds.EQUATIONS`), or be declared with a function that predicts a
reading and gives its Jacobian (`simnav.kinds.Observation`; see ``docs/how-to/add-an-instrument.md``). Such functions
are used here, for every model over the inertial state, in filters and graphs; for a ship without an IMU see
`simnav.estimators.models.ship_observation`.
"""

from __future__ import annotations

from math import isfinite
from pathlib import Path

import numpy as np

from simnav.geometry.earth import earth_rate, principal_radii
from simnav.geometry.rotation import dcm_from_rotation_vector
from simnav.kinds import NavigationPoint
from simnav.plugins import place_of
from simnav.types import KINDS, Array, Datasheet

__all__ = ["OwnObservation"]

#: Number of columns of an observation's Jacobian: position, velocity, attitude.
_COMPONENTS = 9


class OwnObservation:
    """The measurement equation of one instrument.

    Parameters
    ----------
    sheet : Datasheet
        Datasheet of an instrument whose kind has an observation function.

    Raises
    ------
    ValueError
        During a run, if the function of the kind raises, or does not return finite arrays of the right shapes.
    """

    def __init__(self, sheet: Datasheet):
        self.sheet, self.kind = sheet, KINDS[sheet.kind]
        observation = self.kind.observation
        assert observation is not None
        self._observation = observation

    def point(
        self, time: float, position: Array, velocity: Array, dcm: Array, rate: Array, bias: Array
    ) -> NavigationPoint:
        """The state for the function; ``rate`` is the output of the gyroscopes and ``bias`` their bias."""
        turning = rate - bias[:3] - dcm.T @ earth_rate(position[0])
        return NavigationPoint(time, position, velocity, dcm, turning)

    def predict(self, point: NavigationPoint) -> tuple[Array, Array] | None:
        """The (d,) reading at a state and its (d, 9) Jacobian; None if there is no reading at the state."""
        try:
            result = self._observation(point, self.sheet)
        except Exception as error:
            raise ValueError(f"{self._label()} raised {type(error).__name__}: {error}") from error
        if result is None:
            return None
        d = len(self.kind.components)
        try:
            reading, jacobian = (np.asarray(part, dtype=np.float64) for part in result)
            fits = reading.shape == (d,) and jacobian.shape == (d, _COMPONENTS)
            given = f"shapes {reading.shape} and {jacobian.shape}"
        except (TypeError, ValueError):
            fits, given = False, repr(result)
        if not fits:
            raise ValueError(
                f"{self._label()} should return a reading of shape {(d,)} and its Jacobian "
                f"of shape {(d, _COMPONENTS)}, or None, not {given}"
            )
        # A sum is finite where each of its terms is. That of an estimator whose state is not finite is its own fault.
        state = (point.position, point.velocity, point.dcm)
        if not isfinite(reading.sum() + jacobian.sum()) and all(np.isfinite(part).all() for part in state):
            raise ValueError(
                f"{self._label()} should return finite numbers, or None where the state has no reading, not "
                f"{reading.tolist()} with the Jacobian {jacobian.tolist()}"
            )
        return reading, jacobian

    def _label(self) -> str:
        """The function, for messages: of which kind it is, for which instrument, and where it stands."""
        file, line = place_of(self._observation)
        function = getattr(self._observation, "__name__", repr(self._observation))
        place = f"{function}() in {Path(file).name}, line {line}"
        return f"the observation of kind {self.sheet.kind!r} ({place}), for the instrument {self.sheet.name!r},"

    def linearise(
        self, point: NavigationPoint, value: Array, calibration: Array, size: int, bias_at: int
    ) -> tuple[Array, Array] | None:
        """Innovation and Jacobian of a measurement.

        Parameters
        ----------
        point : NavigationPoint
            The state at which the reading is predicted.
        value : (d,) array
            Measured value.
        calibration : (size - 15,) array
            Calibration states of the instruments.
        size : int
            Number n of components of the error state.
        bias_at : int
            Index in the error state of the instrument's first bias; -1 for none.

        Returns
        -------
        innovation : (d,) array
            Measurement minus prediction, in the units of the kind's errors.
        jacobian : (d, n) array
            Jacobian of the prediction with respect to the error state.
        """
        predicted = self.predict(point)
        if predicted is None:
            return None
        reading, own = predicted
        d = len(reading)
        jacobian = np.zeros((d, size))
        jacobian[:, :_COMPONENTS] = own
        if bias_at >= 0:
            jacobian[range(d), range(bias_at, bias_at + d)] = 1.0
            first = bias_at + len(calibration) - size
            reading = self.kind.add_error(reading, calibration[first : first + d])
        return self.kind.difference(value, reading), jacobian

    def differences(self, point: NavigationPoint, errors: Array, bias_at: int) -> Array | None:
        """The predicted readings of the instrument at k states, minus that at one state.

        Parameters
        ----------
        point : NavigationPoint
            The state with which the k states are compared.
        errors : (k, n) array
            Differences of the states from the point, as in `simnav.estimators.models.base.ErrorModel.correct`.
        bias_at : int
            Index of the instrument's first bias state; negative if it has none.

        Returns
        -------
        (k, d) array or None
            Differences of the readings; None if there is no reading at the point. For a state without a reading the
            Jacobian at the point is used.
        """
        predicted = self.predict(point)
        if predicted is None:
            return None
        reading, jacobian = predicted
        differences = errors[:, :_COMPONENTS] @ jacobian.T
        meridian, prime = principal_radii(point.position[0])
        height = point.position[2]
        metres = np.array([meridian + height, (prime + height) * np.cos(point.position[0]), -1.0])
        positions = point.position + errors[:, :3] / metres
        velocities = point.velocity + errors[:, 3:6]
        attitudes = dcm_from_rotation_vector(errors[:, 6:9]) @ point.dcm
        rates = point.angular_rate - errors[:, 9:12]
        for k, state in enumerate(zip(positions, velocities, attitudes, rates, strict=True)):
            there = self.predict(NavigationPoint(point.time, *state))
            if there is not None:
                differences[k] = self.kind.difference(there[0], reading)
        if bias_at >= 0:
            differences += errors[:, bias_at : bias_at + len(reading)]
        return differences
