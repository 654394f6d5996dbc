"""Do IMUs by name drift in the order of their grades, and within the published classes?

A vehicle is at rest, its attitude is known to 0.01 deg at the start, and then nothing aids its IMU. Its vertical motion
is held, as a depth sensor would, because unaided height is unstable. ``simulated`` integrates the samples of the IMU.
``predicted`` is the linear error propagation of a level vehicle with Schuler's oscillation (Titterton and Weston,
*Strapdown Inertial Navigation Technology*, 2004, section 12.3; Groves 2013, section 5.7).

After an hour the attitudes of IMUs of MEMS and industrial grade are wrong by a radian and more. Then the simulated
drift, half of the Earth's circumference, says nothing of the IMU; the linear one still has the order of the biases.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import cos, log, pi, radians, sin, sqrt
from typing import NamedTuple, get_args

import numpy as np

from simnav.geometry import earth
from simnav.geometry.rotation import dcm_from_rpy
from simnav.sensors.imu import ImuSpec
from simnav.sensors.imu_models import IMU_MODELS, Grade
from simnav.strapdown import mechanize
from simnav.types import Array, ImuSamples

__all__ = ["CLASSES", "LOST", "TIMES", "misplaced", "predicted", "rows", "simulated"]

#: When the drift is taken [s].
TIMES = (300.0, 3600.0)
#: Grades with which a vehicle is lost after an hour.
LOST: tuple[Grade, ...] = ("mems", "industrial")
_RATE, _LATITUDE, _TILT = 10.0, radians(54.0), radians(0.01)
_RADIUS, _GRAVITY, _NAUTICAL_MILE = 6.371e6, 9.81, 1852.0
_DEG_H = radians(1.0) / 3600.0
_SCHULER = sqrt(_GRAVITY / _RADIUS)
#: Median of the distance over the standard deviation of its two components.
_MEDIAN = sqrt(2.0 * log(2.0))
_HELD_EVERY = 100


class Drift(NamedTuple):
    """The drift of a grade as it is published.

    Attributes
    ----------
    time : float
        Time without aids [s].
    lowest, highest : float
        Limits of the drift [m].
    source : str
        Where it is published.
    """

    time: float
    lowest: float
    highest: float
    source: str


def _by_gyroscopes(bias: float, time: float) -> float:
    """Median drift by a bias of the gyroscopes [rad/s] alone."""
    return _MEDIAN * _RADIUS * bias * (time - sin(_SCHULER * time) / _SCHULER)


_REVIEW = "N. El-Sheimy and A. Youssef, Satellite Navigation 1:2, 2020, table 1"
CLASSES: dict[Grade, Drift] = {
    "navigation": Drift(3600.0, 0.5 * _NAUTICAL_MILE, 2.0 * _NAUTICAL_MILE, f"1 nmi/h: {_REVIEW}"),
    "intermediate": Drift(
        3600.0, 3.0 * _NAUTICAL_MILE, 20.0 * _NAUTICAL_MILE, "ten times that of aviation grade: Groves 2013, chapter 4"
    ),
    "tactical": Drift(
        3600.0, 10.0 * _NAUTICAL_MILE, _by_gyroscopes(10.0 * _DEG_H, 3600.0),
        f"from 10 nmi/h to that of gyroscopes of 10 deg/h: {_REVIEW}",
    ),
    "industrial": Drift(
        300.0, _by_gyroscopes(10.0 * _DEG_H, 300.0), _by_gyroscopes(radians(0.1), 300.0),
        f"between tactical (10 deg/h) and commercial grade (0.1 deg/s): {_REVIEW}",
    ),
    "mems": Drift(
        300.0, _by_gyroscopes(radians(0.1), 300.0), _by_gyroscopes(radians(1.5), 300.0),
        f"0.1 deg/s: {_REVIEW}; 1.5 deg/s: S. Godha, UCGE Report 20239, 2006",
    ),
}  # fmt: skip


def predicted(spec: ImuSpec, time: float) -> float:
    """Median of the horizontal drift by linear error propagation [m].

    The in-run bias counts as constant.

    Parameters
    ----------
    spec : ImuSpec
        The IMU.
    time : float
        Time without aids [s].
    """
    gyro, force = spec.gyroscope, spec.accelerometer
    by_force = 0.0 if spec.effects is None else spec.effects.gyroscope_g_sensitivity
    w, s, c = _SCHULER, sin(_SCHULER * time), cos(_SCHULER * time)
    turning = earth.ROTATION_RATE * cos(_LATITUDE) * _TILT / sqrt(2.0)  # a wrong heading turns the Earth rate
    drift = (gyro.bias, gyro.bias_instability, gyro.scale * earth.ROTATION_RATE, by_force * _GRAVITY, turning)
    level = (force.bias, force.bias_instability, force.misalignment * _GRAVITY, _TILT * _GRAVITY)
    parts = [
        _RADIUS * (time - s / w) * np.hypot.reduce(drift),
        (1.0 - c) / w**2 * np.hypot.reduce(level),
        _RADIUS * gyro.random_walk * sqrt(1.5 * time - 2.0 * s / w + s * c / (2.0 * w)),
        force.random_walk / w * sqrt(time / 2.0 - s * c / (2.0 * w)),
    ]
    return _MEDIAN * float(np.hypot.reduce(parts))


def simulated(spec: ImuSpec, seeds: Iterable[int], times: tuple[float, ...] = TIMES) -> Array:
    """The (seeds, times) horizontal drift of an unaided IMU at rest [m].

    Parameters
    ----------
    spec : ImuSpec
        The IMU.
    seeds : iterable of int
        Seeds of the runs: of the errors of the IMU, of the heading and of the initial error.
    times : tuple of float
        When the drift is taken [s], in rising order.
    """
    n = round(times[-1] * _RATE)
    time = np.arange(1, n + 1) / _RATE
    interval = np.full(n, 1.0 / _RATE)
    start = np.array([_LATITUDE, 0.0, 0.0])
    gravity = np.array([0.0, 0.0, float(earth.gravity(_LATITUDE, 0.0))])
    found = []
    for seed in seeds:
        rng = np.random.default_rng((seed, 56))
        attitude = np.array([0.0, 0.0, rng.uniform(-pi, pi)])
        to_body = dcm_from_rpy(attitude).T
        ideal = ImuSamples(
            time, interval, np.tile(to_body @ earth.earth_rate(_LATITUDE), (n, 1)), np.tile(-to_body @ gravity, (n, 1))
        )
        sensed = spec.model_copy(update={"rate": _RATE}).build(seed).sense(ideal)
        position, velocity, memory = start.copy(), np.zeros(3), np.zeros(6)
        dcm = dcm_from_rpy(attitude + _TILT * rng.standard_normal(3))
        places = []
        for first in range(0, n, _HELD_EVERY):
            part = slice(first, first + _HELD_EVERY)
            mechanize(position, velocity, dcm, memory, sensed.angular_rate[part], sensed.specific_force[part],
                      interval[part])  # fmt: skip
            position[2] = velocity[2] = 0.0
            places.append(position.copy())
        at = [round(t * _RATE) // _HELD_EVERY - 1 for t in times]
        away = earth.relative_position(np.array(places)[at], start)
        found.append(np.hypot(away[:, 0], away[:, 1]))
    return np.array(found)


def misplaced(drifts: Mapping[str, float], lost: tuple[Grade, ...] = ()) -> list[str]:
    """Pairs of models of different grade of which the better one drifts more.

    Parameters
    ----------
    drifts : mapping of str to float
        Drift of each model [m].
    lost : tuple of str
        Pairs of which both are of these grades do not count.
    """
    order = get_args(Grade)
    return [
        f"{better} ({drifts[better]:.4g} m) drifts more than {worse} ({drifts[worse]:.4g} m)"
        for worse in drifts
        for better in drifts
        if order.index(IMU_MODELS[worse].grade) < order.index(IMU_MODELS[better].grade)
        and not {IMU_MODELS[worse].grade, IMU_MODELS[better].grade} <= set(lost)
        and drifts[better] >= drifts[worse]
    ]


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """See `tests.audit.__main__`."""
    medians, linear = {}, {}
    for name, model in IMU_MODELS.items():
        spec = ImuSpec(rate=_RATE, model=name)
        medians[name] = np.median(simulated(spec, range(40)), axis=0)
        linear[name] = [predicted(spec, time) for time in TIMES]
        of_grade = CLASSES[model.grade]
        drift = linear[name][TIMES.index(of_grade.time)]
        yield (
            f"{name} ({model.grade}), unaided for 300 s and 1 h",
            f"{medians[name][0] / 1e3:.3g} km, {medians[name][1] / _NAUTICAL_MILE:.3g} nmi (linear "
            f"{linear[name][0] / 1e3:.3g} km, {linear[name][1] / _NAUTICAL_MILE:.3g} nmi)",
            f"{of_grade.lowest / _NAUTICAL_MILE:.2g} to {of_grade.highest / _NAUTICAL_MILE:.2g} nmi after "
            f"{of_grade.time:.0f} s ({of_grade.source})",
            of_grade.lowest <= drift <= of_grade.highest,
        )
    for k, time in enumerate(TIMES):
        wrong = misplaced({name: drift[k] for name, drift in linear.items()}) + misplaced(
            {name: float(drift[k]) for name, drift in medians.items()}, LOST if time > 300.0 else ()
        )
        yield f"pairs not in the order of their grades, {time:.0f} s", "; ".join(wrong) or "none", "none", not wrong
