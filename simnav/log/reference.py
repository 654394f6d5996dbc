"""The reference trajectory of a log, at any time: for the epochs, for the start and for simulated instruments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import displace, earth_rate, relative_position
from simnav.geometry.rotation import dcm_from_rpy, wrap_angle
from simnav.log.channel import Series
from simnav.log.imu_series import ImuSeries
from simnav.types import Array, NavigationStates, TapStates

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

__all__ = ["Reference", "Track"]

#: Half the time over which the gyroscopes are averaged for a lever arm [s].
_AROUND = 0.025


class Track:
    """One series, interpolated by a cubic spline; not a number outside of it and inside its holes."""

    def __init__(self, time: Array, value: Array, max_gap: float | None):
        from scipy.interpolate import CubicSpline

        self.time = time
        spacing = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
        self.max_gap = 1.5 * spacing if max_gap is None else max_gap
        self.near = 0.1 * spacing  # so close to a sample a hole beside it does not matter
        self.spline: list[CubicSpline | None] = [
            CubicSpline(time, column) if len(time) > 1 and np.isfinite(column).all() else None for column in value.T
        ]

    def covered(self, time: Array) -> NDArray[np.bool_]:
        tolerance = 1e-6
        if len(self.time) == 1:
            return np.asarray(np.abs(time - self.time[0]) < tolerance)
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        left, right = time - self.time[after - 1], self.time[after] - time
        inside = (left > -tolerance) & (right > -tolerance)
        near = np.minimum(np.abs(left), np.abs(right)) <= self.near
        return np.asarray(inside & ((left + right <= self.max_gap) | near))

    def known(self, time: Array) -> Array:
        """(n, 3) values at n times; not a number outside and in holes."""
        value, covered = np.full((len(time), 3), np.nan), self.covered(time)
        value[covered] = self(time[covered])
        return value

    def __call__(self, time: Array, derivative: int = 0) -> Array:
        """(n, 3) values, or derivatives, at n times; without regard to holes."""
        nothing = np.full(len(time), np.nan)
        return np.stack([nothing if s is None else s(time, derivative) for s in self.spline], axis=-1)


class Reference:
    """The reference trajectory.

    Parameters
    ----------
    position : Series
        Geodetic positions [rad, rad, m].
    velocity, attitude : Series or None
        North-east-down [m/s]; roll, pitch, yaw [rad]. None where the log has none.
    max_gap : float or None
        Longest hole that is interpolated [s]; default one and a half times the usual spacing.
    lever_arm : sequence of 3 floats
        From the IMU to the point that the series describe, body axes [m].
    imu : ImuSeries or None
        Its gyroscopes give the angular rate for the lever arm; without them that of the interpolated attitude is taken.

    Attributes
    ----------
    time : (n,) array
        Times of the positions, on the clock of the log [s].
    """

    def __init__(
        self,
        position: Series,
        velocity: Series | None,
        attitude: Series | None,
        max_gap: float | None = None,
        lever_arm: Sequence[float] = (0.0, 0.0, 0.0),
        imu: ImuSeries | None = None,
    ):
        self.time = position.time
        self._attitude = None if attitude is None else Track(attitude.time, np.unwrap(attitude.value, axis=0), max_gap)
        places, speeds = position.value, None if velocity is None else velocity.value
        lever = np.asarray(lever_arm, dtype=np.float64)
        if lever.any():
            places = displace(places, -self._rotate(position.time, np.broadcast_to(lever, places.shape)))
            if velocity is not None:
                turning = np.cross(self._angular_rate(velocity.time, float(places[0, 0]), imu), lever)
                speeds = velocity.value - self._rotate(velocity.time, turning)
        self._origin = places[0]
        self._position = Track(position.time, relative_position(places, self._origin), max_gap)
        self._velocity = None if velocity is None or speeds is None else Track(velocity.time, speeds, max_gap)

    def states(self, time: Array) -> NavigationStates:
        """The reference at n times; not a number where it has nothing to say (outside, or in a hole)."""
        time = np.asarray(time, dtype=np.float64)
        parts = []
        for track in (self._position, self._velocity, self._attitude):
            parts.append(np.full((len(time), 3), np.nan) if track is None else track.known(time))
        return NavigationStates(time, displace(self._origin, parts[0]), parts[1], wrap_angle(parts[2]))

    def motion(self, time: Array) -> tuple[Array, Array]:
        """Velocity and acceleration, north-east-down, differentiated from the positions."""
        time = np.asarray(time, dtype=np.float64)
        return self._position(time, 1), self._position(time, 2)

    def velocity_ahead(self, time: Array, span: float) -> Array:
        """(n, 2) velocity north and east over the next ``span`` seconds [m/s], less at the end of the reference.

        It is that of the way between two positions, so that the noise of fixes of a vessel that lies still is no speed.
        """
        later = np.minimum(time + span, self.time[-1])
        return np.asarray((self._position(later) - self._position(time))[:, :2] / span)

    def taps(self, time: Array) -> TapStates:
        """What a simulated instrument sees at n times, holes interpolated.

        Velocity comes from the positions where the reference has none. The water is taken to rest. Angular rate is that
        of the interpolated attitude.

        Raises
        ------
        ValueError
            If the reference has no attitude.
        """
        if self._attitude is None:
            raise ValueError("an instrument with source = 'reference' needs [log.reference.attitude]")
        time = np.asarray(time, dtype=np.float64)
        derived, _ = self.motion(time)
        velocity = derived if self._velocity is None else self._velocity(time)
        return TapStates(
            time,
            displace(self._origin, self._position(time)),
            np.where(np.isfinite(velocity), velocity, derived),
            wrap_angle(np.nan_to_num(self._attitude(time))),
            self._attitude_rate(time),
            np.zeros((len(time), 3)),
        )

    def _dcm(self, time: Array) -> Array:
        assert self._attitude is not None
        return dcm_from_rpy(np.nan_to_num(self._attitude(time)))

    def _rotate(self, time: Array, vector: Array) -> Array:
        """Body vectors to north-east-down."""
        return np.asarray(np.einsum("nij,nj->ni", self._dcm(time), vector))

    def _angular_rate(self, time: Array, latitude: float, imu: ImuSeries | None) -> Array:
        """(n, 3) rates of the body relative to the Earth [rad/s]: of the gyroscopes where there are some."""
        rate = self._attitude_rate(time)
        if imu is None:
            return rate
        integral = np.zeros((len(imu.edge), 3))
        np.cumsum(imu.mean[:, :3] * np.diff(imu.edge)[:, None], axis=0, out=integral[1:])
        before, after = time - _AROUND, time + _AROUND
        inside = (before >= imu.edge[0]) & (after <= imu.edge[-1])
        turned = [np.interp(after, imu.edge, a) - np.interp(before, imu.edge, a) for a in integral.T]
        earth = np.einsum("nji,j->ni", self._dcm(time), earth_rate(latitude))
        measured = np.stack(turned, axis=-1) / (2.0 * _AROUND) - earth
        return np.where(inside[:, None], measured, rate)

    def _attitude_rate(self, time: Array) -> Array:
        """The rates of the interpolated roll, pitch and yaw, in body axes (Groves eq. 2.58, inverted)."""
        assert self._attitude is not None
        angle, rate = np.nan_to_num(self._attitude(time)), np.nan_to_num(self._attitude(time, 1))
        sr, cr = np.sin(angle[:, 0]), np.cos(angle[:, 0])
        sp, cp = np.sin(angle[:, 1]), np.cos(angle[:, 1])
        body = [
            rate[:, 0] - rate[:, 2] * sp,
            rate[:, 1] * cr + rate[:, 2] * cp * sr,
            rate[:, 2] * cp * cr - rate[:, 1] * sr,
        ]
        return np.asarray(np.stack(body, axis=-1))
