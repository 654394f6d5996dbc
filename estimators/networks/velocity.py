"""The velocity of a vessel while its DVL gives none, from a recurrent network that sees the IMU and past readings.

Once a second the network has what the IMU and the DVL told in it. It predicts the velocity in body axes at the end of
this second, as a difference from that of the last readings, and the standard deviation of its error. All velocities are
divided by the speed of the vessel, so that one network serves a glider and a ship.

It is in the manner of BeamsNet (N. Cohen and I. Klein, *BeamsNet: A data-driven approach enhancing Doppler velocity log
measurements for autonomous underwater vehicle navigation*, Engineering Applications of Artificial Intelligence 114,
2022) and of its form for outages (N. Cohen, Z. Yampolsky and I. Klein, *Set-Transformer BeamsNet for AUV velocity
forecasting in complete DVL outage scenarios*, 2022): there a convolution of the IMU samples of a second and past
velocities of the DVL give the velocity of one outage. The memory, the inputs and the predicted error are ours; an
outage may have any length. The recipe is `simnav.estimators.training.velocity_network`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from simnav.geometry.rotation import dcm_from_rpy
from simnav.structures import length, structure
from simnav.types import Array, Datasheet, InitialState, Instruments, Measurements

from .file import Network
from .recurrent import advance, flat, shapes

__all__ = [
    "INPUT", "INPUTS", "PERIOD", "RECIPE", "VELOCITIES", "VERSION", "VelocityNetwork", "VelocitySeconds", "shapes_of",
]  # fmt: skip

RECIPE, VERSION = "velocity-network", 1
#: Kinds of instruments that give a whole velocity over ground.
VELOCITIES = ("dvl", "dvl_solution")
#: Time between two inputs [s]; a longer step of the run counts as one.
PERIOD = 1.0
#: The inputs of the network; vectors are forward, starboard, down.
INPUT = structure(
    reading=3, is_heard=float, elapsed=float, rate=3, force=3, vibration=float, sine_turned=float,
    cosine_turned=float, gained=2, speed=float, held=3, spread=float,
)  # fmt: skip
#: Names of the inputs, in order.
INPUTS = (
    "reading_x", "reading_y", "reading_z", "is_heard", "elapsed", "rate_x", "rate_y", "rate_z", "force_x", "force_y",
    "force_z", "vibration", "sine_turned", "cosine_turned", "gained_x", "gained_y", "speed", "held_x", "held_y",
    "held_z", "spread",
)  # fmt: skip
#: Time constants of the last velocity, of its spread and the speed, and of the level of the specific force [s].
_HELD, _SPEED, _LEVEL = 5.0, 30.0, 20.0
#: Least speed [m/s], and bounds of the logarithm of the sigma in speeds.
_SLOWEST, LOWEST, HIGHEST = 0.2, -5.0, 2.0
_OUTPUTS = 6


def shapes_of(arrays: Mapping[str, Array]) -> dict[str, tuple[int, ...]]:
    """The shapes that the arrays of a network should have, by the width of its output weight."""
    weight = arrays.get("output_weight")
    units = weight.shape[-1] if weight is not None and weight.ndim == 2 else 0
    return shapes(length(INPUT), units) | {"output_weight": (_OUTPUTS, units), "output_bias": (_OUTPUTS,)}


class VelocitySeconds:
    """What the IMU and a DVL told in each second, as the inputs of the network.

    Parameters
    ----------
    sheet : Datasheet
        Of the DVL.
    start : InitialState
        The velocity before the first reading.

    Attributes
    ----------
    held : (3,) array
        Fading mean of the last readings, body axes [m/s].
    speed : float
        Fading mean of their size [m/s].
    """

    def __init__(self, sheet: Datasheet, start: InitialState):
        self._name, self._gap = sheet.name, max(2.0 / sheet.rate, PERIOD)
        self.held: Array = dcm_from_rpy(start.attitude).T @ start.velocity
        self.speed = max(float(np.linalg.norm(self.held)), _SLOWEST)
        self._spread, self._level = 0.0, np.array([0.0, 0.0, -9.81])
        self._elapsed, self._turned, self._gained, self._heard = 0.0, 0.0, np.zeros(2), 0
        self._clear()

    def _clear(self) -> None:
        self._time, self._sum, self._square = 0.0, np.zeros(6), np.zeros(3)
        self._readings, self._number = np.zeros(3), 0

    @property
    def is_missing(self) -> bool:
        """Whether readings are missing now, after there were some."""
        return self._heard >= 3 and self._elapsed >= self._gap - 1e-6

    def take(self, measurements: Measurements) -> Array | None:
        """The inputs at the end of a step; None where the second goes on."""
        imu = measurements.imu
        if imu is not None and len(imu):
            both = np.hstack([imu.angular_rate, imu.specific_force]) * imu.interval[:, None]
            self._sum += both.sum(axis=0)
            self._square += (imu.specific_force**2 * imu.interval[:, None]).sum(axis=0)
        for m in measurements:
            if m.instrument == self._name and np.isfinite(m.value).all():
                self._readings += m.value
                self._number += 1
        self._time += measurements.time - measurements.start
        if self._time < PERIOD - 1e-6:
            return None
        inputs = self._inputs(self._time)
        self._clear()
        return inputs

    def _inputs(self, seconds: float) -> Array:
        mean = self._sum / seconds
        rate, force, heard = mean[:3], mean[3:], self._number > 0
        reading = self._readings / max(self._number, 1)
        vibration = float(np.sqrt(np.maximum(self._square / seconds - force**2, 0.0).sum()))
        if heard:
            self._heard += 1
            self._elapsed, self._turned, self._gained = 0.0, 0.0, np.zeros(2)
            self.held += (reading - self.held) * max(-np.expm1(-seconds / _HELD), 1.0 / self._heard)
            part = max(-np.expm1(-seconds / _SPEED), 1.0 / self._heard)
            self.speed += (max(float(np.linalg.norm(reading)), _SLOWEST) - self.speed) * part
            self._spread += (float(np.linalg.norm(reading - self.held)) - self._spread) * part
            self._level += (force - self._level) * max(-np.expm1(-seconds / _LEVEL), 1.0 / self._heard)
        else:
            self._elapsed += seconds
            self._turned += float(rate[2]) * seconds
            self._gained += (force - self._level)[:2] * seconds
        inputs = np.empty(length(INPUT))
        own = inputs.view(INPUT)[0]
        own.reading[:] = np.arcsinh(reading / self.speed)
        own.is_heard, own.elapsed = float(heard), 0.5 * np.log1p(self._elapsed)
        own.rate[:] = np.arcsinh(20.0 * rate)
        own.force[:] = np.arcsinh((force - self._level) / self.speed)
        own.vibration = np.log1p(vibration)
        own.sine_turned, own.cosine_turned = np.sin(self._turned), np.cos(self._turned)
        own.gained[:] = np.arcsinh(self._gained / self.speed)
        own.speed = np.log(self.speed)
        own.held[:] = np.arcsinh(self.held / self.speed)
        own.spread = np.log1p(self._spread / self.speed)
        return inputs


class VelocityNetwork:
    """The network, with its memory in a run.

    Parameters
    ----------
    network : Network
        Of the recipe.
    """

    def __init__(self, network: Network):
        self._weights = flat(network.arrays)
        self._memory = np.zeros(network.arrays["output_weight"].shape[1])

    @staticmethod
    def dvl_of(instruments: Instruments) -> Datasheet | None:
        """The first instrument that gives a whole velocity over ground; None without one."""
        found = instruments.of_kind(*VELOCITIES)
        return found[0] if found else None

    def advance(self, inputs: Array) -> tuple[Array, Array]:
        """Take the inputs of a second.

        Parameters
        ----------
        inputs : (21,) array
            `INPUT`.

        Returns
        -------
        (3,) array
            The velocity minus the last one, in speeds.
        (3,) array
            Standard deviation of its error, in speeds.
        """
        output = np.empty(_OUTPUTS)
        advance(self._weights, inputs, self._memory, output)
        return output[:3], np.exp(np.clip(output[3:], LOWEST, HIGHEST))
