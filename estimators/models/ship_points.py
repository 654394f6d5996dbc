"""The ship model for sigma-point solvers: its motion and measurements for many states at once.

All states but the position are plain numbers (the heading is not wrapped); a point differs from the model's state by
what is added to it, in metres for the position.
"""

from __future__ import annotations

from math import ceil, exp

import numpy as np

from estimators.models.points import PointModel
from estimators.models.ship import CE, CN, HEADING_KINDS, POSITION_KINDS, PSI, STEP, E, N, R, ShipModel, U
from simnav.types import Array, Measurement

__all__ = ["ShipPoints"]


class ShipPoints(ShipModel, PointModel):
    """`ShipModel` with points; the parameters are its own."""

    def states(self, errors: Array) -> Array:
        """(k, n) states of points: metres north and east of the model's own position, and its other states."""
        return np.asarray(self.x + errors)

    def move(self, states: Array, elapsed: float) -> None:
        """Advance (k, n) states by the model's motion, in place, in its own steps (`ShipModel`)."""
        if elapsed <= 0.0:
            return
        steps = max(1, ceil(elapsed / STEP - 1e-9))
        dt = elapsed / steps
        turning = self.turn_time * (1.0 - exp(-dt / self.turn_time))
        decay = np.exp(-self._decay * dt)
        for _ in range(steps):
            turn = turning * states[:, R]
            middle = states[:, PSI] + 0.5 * turn
            states[:, N] += dt * (states[:, U] * np.cos(middle) + states[:, CN])
            states[:, E] += dt * (states[:, U] * np.sin(middle) + states[:, CE])
            states *= decay
            states[:, PSI] += turn

    def propagate_points(self, errors: Array, until: float) -> Array:
        """Advance the state and the points; return the process noise."""
        noise = np.zeros((self.size, self.size))
        states = self.states(np.concatenate([np.zeros((1, self.size)), errors]))
        elapsed = until - self.time
        self.move(states, elapsed)
        errors[:] = states[1:] - states[0]
        self.propagate(noise, until)
        return noise

    def read(self, measurement: Measurement, states: Array) -> Array:
        """(k, m) what an instrument should read at k states; positions in metres from the model's own."""
        sheet = self.instruments[measurement.instrument]
        lx, ly, _ = sheet.lever_arm.tolist()
        u, psi, r = states[:, U], states[:, PSI], states[:, R]
        c, s = np.cos(psi), np.sin(psi)
        at = self.bias_at.get(sheet.name)
        if sheet.kind in HEADING_KINDS:
            reading = states[:, PSI : PSI + 1].copy()
        elif sheet.kind == "speed_log":
            reading = (u - r * ly)[:, None]
            scale = self.scale_at.get(sheet.name)
            if scale is not None:
                reading = reading * (1.0 + states[:, scale : scale + 1])
        elif sheet.kind in POSITION_KINDS:
            reading = np.stack([states[:, N] + c * lx - s * ly, states[:, E] + s * lx + c * ly], axis=1)
        else:
            ahead, across = u - r * ly, r * lx
            cn, ce = states[:, CN], states[:, CE]
            if sheet.kind == "dvl":
                reading = np.stack([ahead + c * cn + s * ce, across - s * cn + c * ce], axis=1)
            else:
                reading = np.stack([c * ahead - s * across + cn, s * ahead + c * across + ce], axis=1)
            at = None  # its bias counts as noise
        if at is not None:
            reading = reading + states[:, at : at + reading.shape[1]]
        return reading

    def observe_points(self, measurement: Measurement, errors: Array) -> Array:
        """What the instrument should read at the points, minus what it should read at the state."""
        reading = self.read(measurement, self.states(np.concatenate([np.zeros((1, self.size)), errors])))
        difference = reading[1:] - reading[0]
        if self.instruments[measurement.instrument].kind in HEADING_KINDS:
            difference = np.arctan2(np.sin(difference), np.cos(difference))
        return np.asarray(difference)
