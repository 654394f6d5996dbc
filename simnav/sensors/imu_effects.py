"""Errors of an IMU that depend on its surroundings, and its bandwidth and delay.

They are named in the table ``[instruments.imu.effects]`` and cost nothing where it is absent. Estimators do not receive
them. The coefficients that are one sigma are drawn for each run.

- **g-sensitivity** of the gyroscopes: the rate error G f with the specific force f; G is a full matrix (Groves 2013,
  section 4.4.4; IEEE Std 952-1997, annex C).
- **Vibration rectification**: the mean error K2 <a^2> that a vibration a leaves behind a quadratic non-linearity K2
  (IEEE Std 1293-2018). The vibration along an axis is the specific force less its mean over about 10 s, and a vibration
  that the motion does not contain, such as that of an engine, of the given root mean square.
- **Temperature**: the bias changes in proportion to a temperature that rises linearly and then stays.
- **Bandwidth**: a Butterworth filter of second order on the true angular rate or specific force. At half the sample
  rate or above, a mean over the sample interval shows nothing of it, and it is left out.
- **Delay**: a sample has the stamp of a time that is later than that of the motion it shows.
"""

from __future__ import annotations

from math import inf

import numpy as np

from simnav.spec import NonNegative, Positive, Spec, quantity
from simnav.streams import stream
from simnav.types import Array, ImuSamples

__all__ = ["Effects", "ImuEffects"]

#: Time over which the mean is taken from which the vibration is counted [s].
_MEAN = 10.0


class ImuEffects(Spec):
    """Errors that depend on specific force, vibration and temperature, and the dynamics of the instrument.

    Attributes
    ----------
    gyroscope_g_sensitivity : float
        Rate error for a specific force, each of nine coefficients, one sigma.
    gyroscope_vibration_rectification, accelerometer_vibration_rectification : float
        Mean error for the square of a vibration, each axis, one sigma.
    vibration : float
        Root mean square of a vibration along each axis, beside that of the motion.
    gyroscope_temperature, accelerometer_temperature : float
        Change of the bias with the temperature, each axis, one sigma.
    temperature_rise, temperature_time : float
        Change of the temperature, and the time that it takes from the start of the run.
    gyroscope_bandwidth, accelerometer_bandwidth : float
        Frequency at which the response is 3 dB down.
    delay : float
        From the motion to the stamp of the sample that shows it.
    """

    gyroscope_g_sensitivity: NonNegative = quantity("deg_h_g", 0.0, also=("deg_s_g",))
    gyroscope_vibration_rectification: NonNegative = quantity("deg_h_g2", 0.0)
    accelerometer_vibration_rectification: NonNegative = quantity("ug_g2", 0.0)
    vibration: NonNegative = quantity("g", 0.0, also=("m_s2",))
    gyroscope_temperature: NonNegative = quantity("deg_h_k", 0.0)
    accelerometer_temperature: NonNegative = quantity("ug_k", 0.0)
    temperature_rise: float = quantity("k", 0.0)
    temperature_time: Positive = quantity("s", 1.0, also=("min",))
    gyroscope_bandwidth: Positive = quantity("hz", inf)
    accelerometer_bandwidth: Positive = quantity("hz", inf)
    delay: NonNegative = quantity("s", 0.0)

    @property
    def names(self) -> dict[str, float]:
        """The effects that are not off, in SI."""
        default = type(self)()
        return {n: v for n in type(self).model_fields if (v := getattr(self, n)) != getattr(default, n)}


class _Filter:
    """A linear filter over blocks of samples. Before the first sample it had settled at its value."""

    def __init__(self, numerator: Array, denominator: Array):
        from scipy.signal import lfilter_zi

        self._b, self._a = numerator, denominator
        self._settled = lfilter_zi(numerator, denominator)
        self._state: Array | None = None

    def __call__(self, x: Array) -> Array:
        from scipy.signal import lfilter

        if self._state is None:
            self._state = self._settled[:, None] * x[:1]
        y, self._state = lfilter(self._b, self._a, x, axis=0, zi=self._state)
        return np.asarray(y)


def _low_pass(bandwidth: float, rate: float) -> _Filter | None:
    if bandwidth >= 0.5 * rate:
        return None
    from scipy.signal import butter

    return _Filter(*butter(2, bandwidth, fs=rate))


class _Delay:
    """A delay of a fixed number of samples, not necessarily whole. Before the first sample nothing had changed."""

    def __init__(self, samples: float):
        self._whole = int(samples)
        self._share = samples - self._whole
        self._before: Array | None = None

    def __call__(self, x: Array) -> Array:
        if self._before is None:
            self._before = np.repeat(x[:1], self._whole + 1, axis=0)
        line = np.concatenate([self._before, x])
        n = len(x)
        self._before = line[n:].copy()
        return np.asarray((1.0 - self._share) * line[1 : n + 1] + self._share * line[:n])


class Effects:
    """The effects of an IMU in one run. They continue from block to block.

    Parameters
    ----------
    spec : ImuEffects
        The effects.
    rate : float
        Sample rate [Hz].
    seed : int
        Seed of the run.
    """

    def __init__(self, spec: ImuEffects, rate: float, seed: int):
        def drawn(name: str, sigma: float, shape: tuple[int, ...]) -> Array:
            if sigma <= 0.0:
                return np.zeros(shape)
            return sigma * stream(seed, "instrument", "imu", "effects", name).standard_normal(shape)

        self._spec = spec
        self._g = drawn("g sensitivity", spec.gyroscope_g_sensitivity, (3, 3))
        self._square = (
            drawn("gyroscope rectification", spec.gyroscope_vibration_rectification, (3,)),
            drawn("accelerometer rectification", spec.accelerometer_vibration_rectification, (3,)),
        )
        rise = spec.temperature_rise
        self._warm = (
            rise * drawn("gyroscope temperature", spec.gyroscope_temperature, (3,)),
            rise * drawn("accelerometer temperature", spec.accelerometer_temperature, (3,)),
        )
        self._low_pass = (_low_pass(spec.gyroscope_bandwidth, rate), _low_pass(spec.accelerometer_bandwidth, rate))
        delayed = spec.delay * rate
        self._delay = (_Delay(delayed), _Delay(delayed)) if delayed > 0.0 else None
        share = min(1.0, 1.0 / (_MEAN * rate))
        self._mean = _Filter(np.array([share]), np.array([1.0, share - 1.0])) if np.any(self._square) else None

    def apply(self, ideal: ImuSamples) -> ImuSamples:
        """The samples of ideal instruments with these effects, for the next block.

        Parameters
        ----------
        ideal : ImuSamples
            Ideal samples, which are not changed.
        """
        force = ideal.specific_force
        errors = [self._errors(i, ideal.time, force) for i in range(2)]
        if self._g.any():
            # Not a matrix product: its rounding may depend on the length of a block.
            errors[0] = errors[0] + sum(self._g[:, j] * force[:, j, None] for j in range(3))
        if self._mean is not None:
            vibration = (force - self._mean(force)) ** 2 + self._spec.vibration**2
            errors = [e + k * vibration for e, k in zip(errors, self._square, strict=True)]
        shown = []
        for i, true in enumerate((ideal.angular_rate, force)):
            low_pass = self._low_pass[i]
            passed = true if low_pass is None else low_pass(true)
            shown.append((passed if self._delay is None else self._delay[i](passed)) + errors[i])
        return ImuSamples(ideal.time, ideal.interval, shown[0], shown[1])

    def _errors(self, i: int, time: Array, force: Array) -> Array:
        """Errors by the temperature, of the gyroscopes (0) or the accelerometers (1)."""
        if not self._warm[i].any():
            return np.zeros_like(force)
        return np.asarray(self._warm[i] * np.clip(time / self._spec.temperature_time, 0.0, 1.0)[:, None])
