"""Instruments whose time stamps are late by an amount that is not known well: the delay is a state.

The datasheet gives the sigma of the offset of the stamps, and of their drift (`simnav.timing.TimingSheet`). A reading
that is stamped t was taken at t - tau. It is predicted at the state that is moved back by tau, with the velocity v, the
acceleration a relative to the Earth (both north-east-down), the body rate w and the direction cosine matrix C::

    p - tau v + tau^2 a / 2,   v - tau a,   C (I - tau [w x])

The derivative of the reading by tau is minus its derivative by the time, ``-H (v, a, C w)`` with the Jacobian H over
position, velocity and attitude. The block is called ``delay``: one constant, or with a drift the process ``clock``,
delay and drift. So whatever has an equation, compiled, with an uncertain lever arm, or of a plug-in, may have a delay.

The acceleration is that of the IMU: ``C (f - b) + g - 2 w_ie x v`` with the specific force f and its bias b (Groves
2013, section 5.4, without the transport rate). On a vessel without an IMU it is that of a steady turn, ``C [w x] C'
v``: then only positions and headings tell the delay. The jitter of stamps is neglected.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from simnav.blocks import NAVIGATION, StateBlock
from simnav.geometry.earth import displace, earth_rate, gravity
from simnav.geometry.rotation import dcm_from_rotation_vector
from simnav.kinds import WATER_SPEED, NavigationPoint, Observation
from simnav.types import KINDS, Array, Datasheet

from .inertial_errors import PART

__all__ = ["DELAY", "acceleration", "is_delayed", "observation_at_delay", "with_delay"]

#: Name of the block.
DELAY = "delay"


def is_delayed(sheet: Datasheet) -> bool:
    """Whether the delay of an instrument is a state."""
    return any(block.name == DELAY for block in sheet.blocks) and sheet.timing is not None


def with_delay(sheet: Datasheet, drifting: bool = True) -> Datasheet:
    """The datasheet, with the block of the delay if its stamps have an offset that is not known well.

    Channels have one clock, and many readings at a time: they have no delay here. Nor has a log through the water,
    whose current is a state of its own.

    Parameters
    ----------
    sheet : Datasheet
        The datasheet.
    drifting : bool
        Whether a drift is a state, too. A model without blocks of the process ``clock`` takes the delay for a constant.
    """
    timing, equation = sheet.timing, KINDS[sheet.kind].equation
    if timing is None or not (timing.offset or (timing.drift and drifting)) or sheet.channels:
        return sheet
    if equation is None or equation == WATER_SPEED or any(block.name == DELAY for block in sheet.blocks):
        return sheet
    if timing.drift and drifting:
        block = StateBlock(DELAY, 2, ("s", ""), (timing.offset, timing.drift), "clock")
    else:
        block = StateBlock(DELAY, 1, "s", timing.offset)
    return replace(sheet, blocks=(*sheet.blocks, block))


def acceleration(position: Array, velocity: Array, dcm: Array, force: Array) -> Array:
    """(3,) acceleration relative to the Earth, north-east-down, from the specific force in body axes [m/s^2]."""
    down = np.array([0.0, 0.0, float(gravity(position[0], position[2]))])
    return np.asarray(dcm @ force + down - 2.0 * np.cross(earth_rate(position[0]), velocity))


def observation_at_delay(inner: Observation) -> Observation:
    """The observation of an instrument at the delay that is among its blocks.

    Parameters
    ----------
    inner : Observation
        That of the instrument without a delay.
    """

    def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, Mapping[str, Array]] | Array | None:
        tau = float(point.blocks[DELAY][0])
        rate, rotation = point.angular_rate, point.dcm
        a = point.acceleration
        if a is None:
            a = rotation @ np.cross(rate, rotation.T @ point.velocity)
        there = point._replace(
            position=displace(point.position, -tau * point.velocity + 0.5 * tau**2 * a),
            velocity=point.velocity - tau * a,
            dcm=rotation @ dcm_from_rotation_vector(-tau * rate),
        )
        found = inner(there, sheet)
        if found is None or isinstance(found, np.ndarray):
            return found
        reading, derivatives = found
        blocks = dict(derivatives) if isinstance(derivatives, Mapping) else {NAVIGATION: derivatives}
        navigation = blocks.get(NAVIGATION)
        if navigation is None:
            return reading, blocks
        motion = np.concatenate([there.velocity, a, there.dcm @ rate])
        size = len(point.blocks[DELAY])
        blocks[DELAY] = np.zeros((len(reading), size))
        blocks[DELAY][:, 0] = -(navigation @ motion)
        moved = np.array(navigation, dtype=np.float64)
        moved[:, PART.velocity] -= tau * moved[:, PART.position]
        blocks[NAVIGATION] = moved
        return reading, blocks

    return observe
