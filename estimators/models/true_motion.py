"""The true motion of a vessel without an IMU, as an inertial unit of navigation grade would have measured it.

An oracle must not be beaten by more than chance, so it has to know what nobody can know better. Of a vessel without an
IMU that is how it moves: a model of its motion is right for some manoeuvres and wrong for others, and a row whose model
happens to suit the manoeuvre beats an oracle with another one. So the oracle is told the motion. It gets the samples of
an inertial unit that is level and has no errors but white noise, of navigation grade. They are made from the truth by
inverting the mechanization (`simnav.inverse_strapdown.increments`). Position, velocity and heading at the start, and
the errors of all aiding instruments, stay unknown. Without the noise the filter would become so sure of the velocity
that the second order of a heading error of a degree, a millimetre a second, would make it inconsistent.
"""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np

from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.inverse_strapdown import increments
from simnav.recording import Recording
from simnav.streams import stream
from simnav.types import ImuDatasheet, ImuSamples, InitialState, Instruments, TriadDatasheet

from .inertial_errors import ERROR, TRIAD

__all__ = ["levelled", "true_motion", "with_imu"]

#: White noise of the unit: 0.002 deg/sqrt(h) [rad/sqrt(s)] and 30 ug/sqrt(Hz) [m/s/sqrt(s)].
ANGLE_RANDOM_WALK, VELOCITY_RANDOM_WALK = radians(0.002) / 60.0, 3e-4

#: Samples between two epochs.
RATE = 20
#: What is left of roll and pitch at the start, one sigma [rad].
LEVEL = 1e-6


def true_motion(recording: Recording) -> ImuSamples:
    """The samples of the unit, `RATE` an epoch of the recording.

    Between two epochs the velocity is the derivative of the cubic that has the true positions and velocities at its
    ends. (Velocities at the epochs alone would alias the short waves, and the positions drift by metres.)
    """
    first, then = recording.initial_truth, recording.data.truth
    time, position, velocity, attitude = (
        np.concatenate([getattr(first, name), getattr(then, name)])
        for name in ("time", "position", "velocity", "attitude")
    )
    s = (np.arange(1, RATE + 1) / RATE)[:, None]
    mean = relative_position(position[1:], position[:-1]) / np.diff(time)[:, None]
    fine = (6.0 * s - 6.0 * s * s) * mean[:, None] + (3.0 * s * s - 2.0 * s) * velocity[1:, None]
    fine += (1.0 - 4.0 * s + 3.0 * s * s) * velocity[:-1, None]
    turned = attitude[:-1, None] + s * wrap_angle(np.diff(attitude, axis=0))[:, None]
    times = time[:-1, None] + s[:, 0] * np.diff(time)[:, None]
    samples, _ = increments(
        np.concatenate([time[:1], times.ravel()]), position[0], np.concatenate([velocity[:1], fine.reshape(-1, 3)]),
        np.concatenate([attitude[:1], turned.reshape(-1, 3)]),
    )  # fmt: skip
    noise = stream(recording.seed, "oracle", "true motion").standard_normal((len(samples), 6))
    noise /= np.sqrt(samples.interval)[:, None]
    return replace(
        samples,
        angular_rate=samples.angular_rate + ANGLE_RANDOM_WALK * noise[:, TRIAD.gyroscopes],
        specific_force=samples.specific_force + VELOCITY_RANDOM_WALK * noise[:, TRIAD.accelerometers],
    )


def with_imu(instruments: Instruments) -> Instruments:
    """The instruments, and the datasheet of the unit."""
    gyroscope = TriadDatasheet(random_walk=ANGLE_RANDOM_WALK)
    accelerometer = TriadDatasheet(random_walk=VELOCITY_RANDOM_WALK)
    imu = ImuDatasheet(RATE / instruments.step, gyroscope, accelerometer, "true_motion")
    return Instruments([*instruments.values()], imu, instruments.step)


def levelled(start: InitialState, recording: Recording) -> InitialState:
    """The start with the true roll and pitch."""
    attitude, covariance = start.attitude.copy(), start.covariance.copy()
    attitude[:2] = recording.initial_truth.attitude[0, :2]
    level = slice(ERROR.attitude, ERROR.heading)
    covariance[level, :] = covariance[:, level] = 0.0
    covariance[level, level] = LEVEL**2 * np.eye(2)
    return replace(start, attitude=attitude, covariance=covariance)
