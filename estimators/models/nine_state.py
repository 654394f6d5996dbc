"""The 9-state model of Guo et al. (2026): position, velocity and attitude, with fixed sigmas and no biases.

The paper's motion constraint between epochs (eq. 3) is the strapdown integration. Here it is done as such
(`simnav.strapdown`), at IMU rate and on the rotating Earth. The printed equation lacks brackets and a square; it should
be ``dp = p' - p - v dt - (C f + g) dt^2 / 2``, ``dv = v' - v - (C f + g) dt``, and the attitude on SO(3). Its noise is
as in eq. 25: fixed sigmas of position, velocity and attitude for a second of motion, for any IMU. (Eq. 4 takes the
residual as its own sigma.) GNSS and DVL have the fixed sigmas given below eq. 5; other instruments have those of their
datasheets. ``C v`` in eq. 5 is ``C' v``, as in eq. 6.

Source: Guo et al. (2026), eqs. 1-6 and 25. The paper prints no sigmas of the motion; ours cover the biases of a
tactical-grade IMU for a second.
"""

from __future__ import annotations

import numpy as np

from simnav.structures import filled
from simnav.types import Array, InitialState, Instruments, Measurement

from .base import Linearised
from .equations import equation_of
from .inertial import InertialModel
from .propagation import IMU_NOISE
from .state_blocks import StateBlocks

__all__ = ["NineStateModel"]


class NineStateModel(InertialModel):
    """Nine states with fixed sigmas (see the module).

    Parameters
    ----------
    sigma_position, sigma_velocity, sigma_attitude_deg : float
        Standard deviations of one second of motion [m], [m/s], [deg]; variances grow in proportion to time.
    sigma_gnss_horizontal, sigma_gnss_vertical : float
        Standard deviations of a GNSS position, per component [m]; 0 takes those of the datasheet.
    sigma_dvl : float
        Standard deviation of a DVL velocity, per component [m/s]; 0 takes that of the datasheet.
    """

    fused = False

    def __init__(
        self,
        sigma_position: float = 0.01,
        sigma_velocity: float = 0.02,
        sigma_attitude_deg: float = 0.01,
        sigma_gnss_horizontal: float = 2.5,
        sigma_gnss_vertical: float = 5.0,
        sigma_dvl: float = 0.1,
    ):
        super().__init__(calibrate=False)
        motion = np.repeat([sigma_position, sigma_velocity, np.radians(sigma_attitude_deg)], 3)
        self._motion = np.diag(motion**2)
        self._gnss = np.array([sigma_gnss_horizontal, sigma_gnss_horizontal, sigma_gnss_vertical])
        self._dvl = sigma_dvl

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without an IMU."""
        self._unused = super().begin(start, instruments)
        self.size, self.blocks = 9, StateBlocks(9)
        self._full = np.zeros(15)
        self._noise = filled(IMU_NOISE, interval=self._noise.view(IMU_NOISE)[0].interval)
        for sheet in instruments.values():
            equation = equation_of(sheet)
            if equation.has_height and np.all(self._gnss > 0.0):
                self.noise[sheet.name] = np.diag(self._gnss**2)
            elif equation.in_body and self._dvl > 0.0:
                self.noise[sheet.name] = self._dvl**2 * np.eye(3)
        return np.array(start.covariance, dtype=np.float64)

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance through the samples loaded."""
        elapsed = until - self.time
        if elapsed <= 0.0:
            return
        self._unused[:] = 0.0
        super().propagate(self._unused, until)
        F = self.transition[:9, :9]
        # Of the inertial model's noise only that of a time without IMU data is used.
        covariance[:] = F @ covariance @ F.T + self.process_noise[:9, :9] + elapsed * self._motion
        covariance += covariance.T.copy()
        covariance *= 0.5

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error through the last propagation, in place."""
        error[:] = self.transition[:9, :9] @ error

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement (`simnav.estimators.models.measurements`)."""
        linearised = super().measure(measurement)
        if linearised is None:
            return None
        return linearised._replace(jacobian=np.ascontiguousarray(linearised.jacobian[:, :9]))

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        self._full[:9] = dx
        super().correct(self._full)
