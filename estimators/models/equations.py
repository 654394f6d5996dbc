"""The compiled measurement equations as objects: what each means to the states and the noise of a model.

`simnav.kinds.EQUATIONS` names them. A model, a solver or an adaptation asks `equation_of` a datasheet, and does not
compare names. The Jacobians are compiled (`simnav.estimators.models.measurements.observe_inertial`, by ``code``); the
reading alone is a function (`simnav.estimators.models.readings`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from simnav import kinds
from simnav.blocks import LEVER_ARM
from simnav.kinds import NavigationPoint
from simnav.types import KINDS, Array, Datasheet

from . import measurements as codes
from .readings import READINGS

__all__ = ["EQUATIONS", "Equation", "equation_of", "equation_of_kind"]


_NO_ERRORS: Mapping[str, Array] = MappingProxyType({})


class Equation:
    """A measurement equation; this class is that of an instrument without a compiled one.

    Attributes
    ----------
    name : str
        Its name in `simnav.kinds.EQUATIONS`; empty for none.
    code : int
        What the compiled loops call it.
    is_position, has_height, is_heading : bool
        Whether the reading begins with latitude and longitude; whether a height follows; whether it is a heading.
    is_fix, is_log : bool
        Whether it comes from a receiver of satellites whatever the role of its kind; whether it is the speed of a log.
    in_body : bool
        Whether it is the whole velocity in body axes: such an instrument has a misalignment.
    through_water : bool
        Whether it is the speed through the water, which is that over the ground less the current.
    has_scale : bool
        Whether a scale factor of the datasheet applies.
    calibrates : bool
        Whether a model has states for scale factor and misalignment.
    """

    name: ClassVar[str] = ""
    code: ClassVar[int] = codes.OWN
    is_position: ClassVar[bool] = False
    has_height: ClassVar[bool] = False
    is_heading: ClassVar[bool] = False
    is_fix: ClassVar[bool] = False
    is_log: ClassVar[bool] = False
    in_body: ClassVar[bool] = False
    through_water: ClassVar[bool] = False
    has_scale: ClassVar[bool] = False
    calibrates: ClassVar[bool] = False

    def read(self, point: NavigationPoint, sheet: Datasheet, errors: Mapping[str, Array] = _NO_ERRORS) -> Array | None:
        """The (d,) reading at a state; None where there is none.

        Parameters
        ----------
        point : NavigationPoint
            The state.
        sheet : Datasheet
            Datasheet of the instrument.
        errors : mapping of str to array
            Values of its errors but the bias, by name (`simnav.estimators.models.declared_errors`). ``current``, north
            and east, is the velocity of the water; ``lever_arm`` is added to that of the datasheet.
        """
        if LEVER_ARM in errors:
            sheet = replace(sheet, lever_arm=sheet.lever_arm + errors[LEVER_ARM])
        if self.through_water and "current" in errors:
            point = point._replace(velocity=point.velocity - np.append(errors["current"], 0.0))
        reading = READINGS[self.name](point, sheet)
        if reading is None or errors.keys().isdisjoint(("scale", "misalignment")):
            return reading
        turned = np.cross(reading, errors["misalignment"]) if "misalignment" in errors else 0.0
        return np.asarray((1.0 + errors.get("scale", 0.0)) * reading + turned)

    def white_noise(self, sheet: Datasheet, faster: Array | float, rate_variance: float) -> Array:
        """(d, d) noise: that of the instrument, biases ``faster`` than a state, gyroscope noise times the lever arm."""
        noise = np.diag(sheet.sigma**2 + faster)
        self._add_rate_noise(noise, sheet.lever_arm, rate_variance)
        return noise

    def _add_rate_noise(self, noise: Array, arm: Array, rate_variance: float) -> None:
        """Add the noise of the gyroscopes to that of a velocity, in place; here there is none."""

    def uncalibrated_noise(self, sheet: Datasheet, predicted: Array) -> Array:
        """(d, d) noise in place of a scale factor and a misalignment without states, at a ``predicted`` velocity."""
        u, m = predicted**2, sheet.misalignment**2
        variance = sheet.scale**2 * u
        if self.in_body:
            variance += [m[1] * u[2] + m[2] * u[1], m[0] * u[2] + m[2] * u[0], m[0] * u[1] + m[1] * u[0]]
        return np.diag(variance)

    def in_body_axes(self, value: Array) -> Array:
        """(3,) velocity in body axes from the reading of a log; what it does not measure is zero."""
        raise NotImplementedError(f"{self.name or 'the instrument'} gives no velocity in body axes")


class _Position(Equation):
    name, code, is_position, has_height = kinds.POSITION, codes.GNSS_POSITION, True, True


class _HorizontalPosition(Equation):
    name, code, is_position = kinds.HORIZONTAL_POSITION, codes.TERRAIN_FIX, True


class _Velocity(Equation):
    name, code, is_fix = kinds.VELOCITY, codes.GNSS_VELOCITY, True

    def _add_rate_noise(self, noise: Array, arm: Array, rate_variance: float) -> None:
        noise += rate_variance * (arm @ arm) * np.eye(3)


class _BodyVelocity(Equation):
    name, code, is_log, in_body, has_scale, calibrates = kinds.BODY_VELOCITY, codes.DVL, True, True, True, True

    def _add_rate_noise(self, noise: Array, arm: Array, rate_variance: float) -> None:
        noise += rate_variance * (arm @ arm * np.eye(3) - np.outer(arm, arm))

    def in_body_axes(self, value: Array) -> Array:
        return value


class _WaterSpeed(Equation):
    name, code, is_log, through_water = kinds.WATER_SPEED, codes.SPEED_LOG, True, True
    has_scale = calibrates = True

    def _add_rate_noise(self, noise: Array, arm: Array, rate_variance: float) -> None:
        noise += rate_variance * (arm[1:] @ arm[1:])

    def in_body_axes(self, value: Array) -> Array:
        return np.array([float(value[0]), 0.0, 0.0])


class _Heading(Equation):
    name, code, is_heading = kinds.HEADING, codes.HEADING, True


class _Depth(Equation):
    name, code, has_scale = kinds.DEPTH, codes.DEPTH, True


#: Every compiled equation by its name.
EQUATIONS: Mapping[str, Equation] = {
    cls.name: cls() for cls in (_Position, _HorizontalPosition, _Velocity, _BodyVelocity, _WaterSpeed, _Heading, _Depth)
}
_NONE = Equation()


def equation_of(sheet: Datasheet) -> Equation:
    """The equation of an instrument; `Equation` itself where its kind has one of its own, or none."""
    return EQUATIONS.get(sheet.equation, _NONE)


def equation_of_kind(kind: str) -> Equation:
    """The equation of a kind of instrument, likewise."""
    equation = KINDS[kind].equation
    return EQUATIONS.get(equation, _NONE) if isinstance(equation, str) else _NONE
