"""Instruments with a compiled measurement equation of which the lever arm is not known well.

Their datasheet brings a block of states ``lever_arm`` along (`simnav.sensors.AidSpec.blocks`). The compiled loops have
no place for it. So here the equation is a function with states, like that of a kind of somebody else
(`simnav.estimators.models.measurement_functions`). The scale factor and the misalignment become blocks, too.

With position p, velocity v, direction cosine matrix C, lever arm l and body rate w relative to the Earth, the
derivatives by the error of the lever arm are (Groves 2013, section 14.3): ``C`` for a position, ``C [w x]`` for a
velocity north-east-down, ``[w x]`` for one in body axes, and the last row of ``C`` for a depth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from simnav import kinds
from simnav.blocks import LEVER_ARM, NAVIGATION
from simnav.geometry.rotation import skew
from simnav.kinds import NavigationPoint, Observation
from simnav.types import KINDS, Array, Datasheet, Instruments

from .declared_errors import errors_of
from .delayed import is_delayed, observation_at_delay, with_delay
from .equations import equation_of
from .inertial_errors import PART

__all__ = ["has_measurement_function", "observation_of", "with_lever_arms"]


def has_measurement_function(sheet: Datasheet) -> bool:
    """Whether an instrument is observed by a function, and not by a compiled equation."""
    return KINDS[sheet.kind].observation is not None or _has_states(sheet)


def observation_of(sheet: Datasheet) -> Observation | None:
    """The function that predicts the reading of an instrument; None if its equation is compiled, or there is none."""
    observation = _observe if _has_states(sheet) else KINDS[sheet.kind].observation
    return observation_at_delay(observation) if observation is not None and is_delayed(sheet) else observation


def _has_states(sheet: Datasheet) -> bool:
    own = any(block.name == LEVER_ARM for block in sheet.blocks) or is_delayed(sheet)
    return KINDS[sheet.kind].observation is None and own


def with_lever_arms(instruments: Instruments, drifting: bool = True) -> Instruments:
    """The datasheets, with unknown delays as blocks, and scale factor and misalignment where lever arm or delay is.

    Parameters
    ----------
    instruments : Instruments
        The datasheets.
    drifting : bool
        Whether the drift of a delay is a state (`with_delay`).
    """
    delayed = instruments.changed(lambda sheet: with_delay(sheet, drifting))
    if not any(_has_states(sheet) or is_delayed(sheet) for sheet in delayed.values()):
        return instruments
    return delayed.changed(lambda sheet: _with_blocks(sheet) if _has_states(sheet) else sheet)


def _with_blocks(sheet: Datasheet) -> Datasheet:
    errors = errors_of(sheet)
    more = [block for name in ("scale", "misalignment") if name in errors for block in errors[name].processes]
    return replace(sheet, blocks=(*sheet.blocks, *more), scale=0.0, misalignment=np.zeros(3))


def _observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, Mapping[str, Array]] | Array | None:
    """The reading and its Jacobian by block; of a heading the reading alone."""
    equation, errors = equation_of(sheet), point.blocks
    arm = sheet.lever_arm + errors.get(LEVER_ARM, 0.0)
    reading = equation.read(point, sheet, errors)
    if reading is None or sheet.equation not in _DERIVATIVES:
        return reading
    navigation, by_arm = _DERIVATIVES[sheet.equation](point, arm)
    blocks = {NAVIGATION: navigation}
    if LEVER_ARM in errors:
        blocks[LEVER_ARM] = by_arm
    if not errors.keys().isdisjoint(("scale", "misalignment")):
        bare = equation.read(point, sheet, {name: errors[name] for name in (LEVER_ARM,) if name in errors})
        assert bare is not None, "it has a reading with its other errors"
        if "scale" in errors:
            blocks["scale"] = bare[:, None]
        if "misalignment" in errors:
            blocks["misalignment"] = skew(bare)
    return reading, blocks


def _no_derivative() -> Array:
    """A Jacobian of three components by position, velocity and attitude, of zeros."""
    return np.zeros((3, PART.navigation.stop))


def _position(point: NavigationPoint, arm: Array) -> tuple[Array, Array]:
    jacobian = _no_derivative()
    jacobian[:, PART.position] = np.eye(3)
    jacobian[:, PART.attitude] = -skew(point.dcm @ arm)
    return jacobian, point.dcm


def _horizontal_position(point: NavigationPoint, arm: Array) -> tuple[Array, Array]:
    jacobian, by_arm = _position(point, arm)
    return jacobian[:2], by_arm[:2]


def _depth(point: NavigationPoint, arm: Array) -> tuple[Array, Array]:
    jacobian, by_arm = _position(point, arm)
    return jacobian[2:], by_arm[2:]


def _velocity(point: NavigationPoint, arm: Array) -> tuple[Array, Array]:
    jacobian, turning = _no_derivative(), skew(point.angular_rate)
    jacobian[:, PART.velocity] = np.eye(3)
    jacobian[:, PART.attitude] = -skew(point.dcm @ (turning @ arm))
    return jacobian, point.dcm @ turning


def _body_velocity(point: NavigationPoint, arm: Array) -> tuple[Array, Array]:
    jacobian, to_body = _no_derivative(), point.dcm.T
    jacobian[:, PART.velocity] = to_body
    jacobian[:, PART.attitude] = to_body @ skew(point.velocity)
    return jacobian, skew(point.angular_rate)


#: The Jacobians of a reading without scale factor and misalignment, which change them in second order only.
_DERIVATIVES: Mapping[str, Callable[[NavigationPoint, Array], tuple[Array, Array]]] = {
    kinds.POSITION: _position,
    kinds.HORIZONTAL_POSITION: _horizontal_position,
    kinds.VELOCITY: _velocity,
    kinds.BODY_VELOCITY: _body_velocity,
    kinds.DEPTH: _depth,
}
