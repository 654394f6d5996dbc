"""The ship dead-reckoning model: position, speed, heading, turn rate and current, for a ship without an INS.

State: latitude and longitude; forward speed u through the water; heading psi; turn rate r; current c (north, east);
and, as the datasheets ask for them, a bias for each compass and log and a scale factor for each log. Motion:

- p' = u (cos psi, sin psi) + c
- u' = white noise; psi' = r; r' = -r/T + noise; c' = -c/T + noise; biases after `estimators.models.base.gauss_markov`

Speed and heading as states, with log and compass as measurements of them, let their biases be found while there is GNSS
and carry the position through an outage. Height, roll and pitch are not estimated; a lever arm is turned by the heading
alone, and what heel does to it is noise. Sideways motion through the water (waves, leeway) is noise on measured
velocities and in the estimate's velocity.

After paper 002 (GNSS/DR integrated navigation for ships): position, speed, heading, log bias, compass bias, 1 Hz; the
turn rate and the current are ours, since a log measures through the water.
"""

from __future__ import annotations

from math import atan2, ceil, cos, exp, sin

import numpy as np

from estimators.models.base import ErrorModel, GaussMarkov, Linearised, gauss_markov
from estimators.models.measurements import radii, wrap
from simnav.estimator import UnsuitableScenario
from simnav.types import Array, Datasheet, Estimate, InitialState, Instruments, Measurement

__all__ = ["ShipModel"]

POSITION_KINDS = ("gnss_position", "terrain_fix")
HEADING_KINDS = ("magnetic_compass", "gyrocompass")
#: Longest step of the integration [s].
STEP = 1.0
#: Roll and pitch that a lever arm is not corrected for, one sigma [rad].
HEEL = 0.03
N, E, U, PSI, R, CN, CE = range(7)
_BASE = 7


class ShipModel(ErrorModel):
    """The model of the module.

    Parameters
    ----------
    acceleration : float
        Noise density of the speed [m/s/sqrt(s)].
    turn_rate, turn_time : float
        Stationary sigma [rad/s] and correlation time [s] of the turn rate.
    current, current_time : float
        Likewise of each component of the current [m/s], [s].
    sway : float
        Sigma of the sideways velocity through the water [m/s].
    """

    state = ("position", "x")

    def __init__(
        self,
        acceleration: float = 0.05,
        turn_rate: float = 0.01,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
    ):
        self.acceleration = acceleration
        self.turn_rate, self.turn_time = turn_rate, turn_time
        self.current, self.current_time = current, current_time
        self.sway = sway

    def observes(self, instrument: Datasheet) -> bool:
        """Whether it is a position, velocity, speed or heading."""
        return instrument.kind in (*POSITION_KINDS, *HEADING_KINDS, "gnss_velocity", "dvl", "speed_log")

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario if there is nothing that gives a speed and a heading."""
        self.instruments = instruments
        if not any(self.observes(s) for s in instruments.values()):
            raise UnsuitableScenario("the ship model needs GNSS, a compass or a log; there is none of them")
        self.time = start.time
        self.position = np.array(start.position, dtype=np.float64)
        states: list[GaussMarkov] = [
            GaussMarkov(0.0, 0.0, self.acceleration**2, 0.0),
            GaussMarkov(float(start.covariance[8, 8]), 0.0, 0.0, 0.0),
            _stationary(self.turn_rate, self.turn_time),
            _stationary(self.current, self.current_time),
            _stationary(self.current, self.current_time),
        ]
        self.bias_at: dict[str, int] = {}
        self.scale_at: dict[str, int] = {}
        for sheet in instruments.values():
            if sheet.kind not in (*HEADING_KINDS, *POSITION_KINDS, "speed_log"):
                continue
            d = 2 if sheet.kind in POSITION_KINDS else 1
            biases = [
                gauss_markov(b, s, sheet.correlation_time, shortest=0.5 / sheet.rate)
                for b, s in zip(sheet.bias[:d], sheet.bias_instability[:d])
            ]
            if any(b.variance or b.noise for b in biases):
                self.bias_at[sheet.name] = 2 + len(states)
                states += biases
            if sheet.kind == "speed_log" and sheet.scale:
                self.scale_at[sheet.name] = 2 + len(states)
                states.append(GaussMarkov(sheet.scale**2, 0.0, 0.0, 0.0))
        self.size = n = 2 + len(states)
        self._decay = np.array([0.0, 0.0, *(s.decay for s in states)])
        self._density = np.array([0.0, 0.0, *(s.noise for s in states)])
        psi = float(start.attitude[2])
        self.x = np.zeros(n)  # u, psi, r, c, biases at their indices; the position is kept apart
        self.x[PSI] = psi
        P = np.zeros((n, n))
        P[:2, :2] = start.covariance[:2, :2]
        P[range(2, n), range(2, n)] = [s.variance for s in states]
        # The initial ground velocity is a measurement of u and c, whose prior for u says nothing.
        P[U, U] = 1e4
        c, s = cos(psi), sin(psi)
        self.x[U] = c * start.velocity[0] + s * start.velocity[1]
        H = np.zeros((2, n))
        H[0, U], H[0, PSI], H[0, CN] = c, -self.x[U] * s, 1.0
        H[1, U], H[1, PSI], H[1, CE] = s, self.x[U] * c, 1.0
        cross = P @ H.T
        noise = start.covariance[3:5, 3:5] + self.sway**2 * np.eye(2)
        gain = np.linalg.solve(H @ cross + noise, cross.T).T
        self.x += gain @ (start.velocity[:2] - self.x[U] * np.array([c, s]))
        joseph = np.eye(n) - gain @ H
        P = joseph @ P @ joseph.T + gain @ noise @ gain.T
        self._height_variance = float(start.covariance[2, 2])
        return np.ascontiguousarray(P)

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance."""
        elapsed = until - self.time
        if elapsed <= 0.0:
            return
        steps = max(1, ceil(elapsed / STEP - 1e-9))
        self._transition = np.eye(self.size)
        for _ in range(steps):
            self._step(covariance, elapsed / steps)
        self.time = until

    def _step(self, P: Array, dt: float) -> None:
        x = self.x
        u, r = float(x[U]), float(x[R])
        shrink = exp(-dt / self.turn_time)
        turning = self.turn_time * (1.0 - shrink)  # integral of the decaying turn rate
        middle = float(x[PSI]) + 0.5 * turning * r
        c, s = cos(middle), sin(middle)
        latitude = float(self.position[0])
        meridian, prime = radii(latitude)
        self.position[0] = latitude + dt * (u * c + float(x[CN])) / (meridian + self.position[2])
        self.position[1] += dt * (u * s + float(x[CE])) / ((prime + self.position[2]) * cos(latitude))
        decay = np.exp(-self._decay * dt)
        F = np.diag(decay)
        F[PSI, R] = turning
        F[N, U], F[N, PSI], F[N, R], F[N, CN] = dt * c, -dt * u * s, -0.5 * turning * dt * u * s, dt
        F[E, U], F[E, PSI], F[E, R], F[E, CE] = dt * s, dt * u * c, 0.5 * turning * dt * u * c, dt
        x *= decay
        x[PSI] += turning * r
        # Half the noise before and half after the step: second order in its length.
        half = np.diag(0.5 * dt * self._density)
        P += half
        P[:] = F @ P @ F.T
        P += half
        self._transition = F @ self._transition

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error, or several in columns, through the last propagation, in place."""
        error[...] = self._transition @ error

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement."""
        sheet = self.instruments[measurement.instrument]
        x = self.x
        u, psi, r = float(x[U]), float(x[PSI]), float(x[R])
        c, s = cos(psi), sin(psi)
        at = self.bias_at.get(sheet.name)
        lx, ly, lz = sheet.lever_arm.tolist()
        fast = sheet.bias_instability**2 if sheet.correlation_time < 0.5 / sheet.rate else 0.0
        white = sheet.sigma**2 + fast
        if sheet.kind in HEADING_KINDS or sheet.kind == "speed_log":
            H = np.zeros((1, self.size))
            if sheet.kind == "speed_log":
                predicted, factor = u - r * ly, 1.0
                scale = self.scale_at.get(sheet.name)
                if scale is not None:
                    factor += float(x[scale])
                    H[0, scale] = predicted
                H[0, U], H[0, R] = factor, -factor * ly
                predicted *= factor
            else:
                H[0, PSI], predicted = 1.0, psi
            if at is not None:
                H[0, at] = 1.0
                predicted += float(x[at])
            innovation = float(measurement.value[0]) - predicted
            if sheet.kind != "speed_log":
                innovation = wrap(innovation)
            return Linearised(np.array([innovation]), H, white.reshape(1, 1))
        H = np.zeros((2, self.size))
        if sheet.kind in POSITION_KINDS:
            arm = np.array([c * lx - s * ly, s * lx + c * ly])
            latitude, longitude, height = self.position.tolist()
            meridian, prime = radii(latitude)
            offset = np.array([
                (float(measurement.value[0]) - latitude) * (meridian + height),
                wrap(float(measurement.value[1]) - longitude) * (prime + height) * cos(latitude),
            ])  # fmt: skip
            H[0, N] = H[1, E] = 1.0
            H[0, PSI], H[1, PSI] = -arm[1], arm[0]
            if at is not None:
                H[0, at] = H[1, at + 1] = 1.0
                offset -= x[at : at + 2]
            return Linearised(offset - arm, H, np.diag(white[:2] + (HEEL * lz) ** 2))
        # Velocity of the instrument along and across the heading, in north-east.
        current = x[CN : CE + 1]
        turn = np.array([[c, -s], [s, c]])
        ahead = np.array([u - r * ly, r * lx])
        H[:, U] = turn[:, 0]
        H[:, R] = turn @ (-ly, lx)
        H[:, PSI] = turn @ (-ahead[1], ahead[0])
        H[0, CN] = H[1, CE] = 1.0
        predicted = turn @ ahead + current
        extra = sheet.bias[:2] ** 2 + (0.0 if np.ndim(fast) else sheet.bias_instability[:2] ** 2)
        if sheet.kind == "dvl":  # body axes
            to_body = turn.T
            v = to_body @ predicted
            H = to_body @ H
            H[:, PSI] -= (-v[1], v[0])
            extra = extra + (sheet.scale * v) ** 2 + (sheet.misalignment[2] * v[::-1]) ** 2 + (HEEL * self.sway) ** 2
            noise = np.diag(white[:2] + extra) + np.diag([0.0, self.sway**2])
            return Linearised(measurement.value[:2] - v, H, noise)
        sideways = np.outer(turn[:, 1], turn[:, 1]) * self.sway**2
        return Linearised(measurement.value[:2] - predicted, H, np.diag(white[:2] + extra) + sideways)

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        latitude, _, height = self.position.tolist()
        meridian, prime = radii(latitude)
        self.position[0] += dx[N] / (meridian + height)
        self.position[1] += dx[E] / ((prime + height) * cos(latitude))
        self.x[2:] += dx[2:]

    def estimate(self, covariance: Array) -> Estimate:
        """Horizontal position and velocity, and heading."""
        x = self.x
        psi = float(x[PSI])
        c, s = cos(psi), sin(psi)
        u = float(x[U])
        velocity = np.array([u * c + x[CN], u * s + x[CE], 0.0])
        # Errors of the nine components from those of the state.
        G = np.zeros((9, self.size))
        G[0, N] = G[1, E] = G[8, PSI] = 1.0
        G[3, U], G[3, PSI], G[3, CN] = c, -u * s, 1.0
        G[4, U], G[4, PSI], G[4, CE] = s, u * c, 1.0
        full = G @ covariance @ G.T
        sideways = np.array([-s, c])
        full[3:5, 3:5] += self.sway**2 * np.outer(sideways, sideways)
        full[2, 2], full[5, 5] = self._height_variance, 1.0
        full[6, 6] = full[7, 7] = HEEL**2
        attitude = np.array([0.0, 0.0, atan2(s, c)])
        return Estimate(self.time, self.position.copy(), velocity, attitude, full, ESTIMATED)


def _stationary(sigma: float, time: float) -> GaussMarkov:
    return GaussMarkov(sigma**2, 1.0 / time, 2.0 * sigma**2 / time, 0.0)


#: North, east, their velocities, and heading.
ESTIMATED = np.array([True, True, False, True, True, False, False, False, True])
