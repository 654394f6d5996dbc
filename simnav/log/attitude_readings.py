"""How the attitude of a reference may be read: signs, order and frame of angles, or of a quaternion."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np

from simnav.geometry.rotation import (
    dcm_from_quaternion,
    dcm_from_rpy,
    quaternion_from_dcm,
    rpy_from_dcm,
    wrap_angle,
)
from simnav.log.channel import Series
from simnav.log.hypotheses import FLIPS, Reading, flip, shown, with_series
from simnav.log.spec import ChannelSpec

__all__ = ["of_attitude"]

#: From axes forward, left, up to forward, starboard, down; from east, north, up to north, east, down, and back.
_LEFT = np.array([1.0, -1.0, -1.0])
_EAST = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def of_attitude(channel: ChannelSpec, series: Series) -> Iterator[Reading]:
    """All hypotheses about the attitude of a reference.

    Parameters
    ----------
    channel : ChannelSpec
        As the scenario has it: three angles, or the four numbers of a quaternion.
    series : Series
        Roll, pitch, yaw [rad] as they are read with it.
    """
    return (_of_quaternion if len(channel.columns) == 4 else _of_angles)(channel, series)


def _of_angles(channel: ChannelSpec, series: Series) -> Iterator[Reading]:
    """Signs of roll, pitch and yaw, roll for pitch, and yaw counted from east."""
    table = "log.reference.attitude"
    a, b, c = series.value.T
    if channel.frame == "enu":
        b, c = -b, 0.5 * np.pi - c
    for swap, roll, pitch, yaw, east in itertools.product((False, True), FLIPS, FLIPS, FLIPS, (False, True)):
        columns = list(channel.columns)
        columns[:2] = columns[1::-1] if swap else columns[:2]
        columns = [n if sign > 0.0 else flip(n) for n, sign in zip(columns, (roll, pitch, yaw), strict=True)]
        other_frame = east != (channel.frame == "enu")
        changes: list[tuple[str, str, Any]] = [(table, "columns", columns)] if columns != list(channel.columns) else []
        changes += [(table, "frame", "enu" if east else "geodetic")] if other_frame else []
        if not changes:
            continue
        x, y, z = roll * (b if swap else a), pitch * (a if swap else b), yaw * c
        value = np.stack([x, -y if east else y, wrap_angle(0.5 * np.pi - z if east else z)], axis=-1)
        number = 2.0 * swap + (roll < 0.0) + (pitch < 0.0) + (yaw < 0.0) + other_frame
        what = f"roll, pitch, yaw of the reference are {shown(columns)}" + (
            f", of axes {'east, north, up' if east else 'north, east, down'}" if other_frame else "")  # fmt: skip
        yield Reading("reference.attitude", ("reference.attitude",),
                       with_series("reference.attitude", value=value), number, what,
                       tuple(changes))  # fmt: skip


def _of_quaternion(channel: ChannelSpec, series: Series) -> Iterator[Reading]:
    """Order of a quaternion (scalar first or last), its inverse (Hamilton, JPL), axes of the body and of the world."""
    table, present = "log.reference.attitude", list(channel.columns)
    dcm = dcm_from_rpy(series.value)
    quaternion = quaternion_from_dcm(_EAST @ dcm * _LEFT if channel.frame == "enu" else dcm)
    orders = ((0, 1, 2, 3), (3, 0, 1, 2), (1, 2, 3, 0))
    flipped = (1, -1.0), (0, 1.0), (3, 1.0), (2, -1.0)  # turned by 180 deg about the forward axis of the body
    for order, inverse, turned, east in itertools.product(orders, (False, True), (False, True), (False, True)):
        other_frame = east != (channel.frame == "enu")
        number = float((order != orders[0]) + inverse + 1.5 * turned + other_frame)
        if not number:
            continue
        chosen = [(i, -1.0 if inverse and k else 1.0) for k, i in enumerate(order)]
        if turned:
            chosen = [(chosen[i][0], sign * chosen[i][1]) for i, sign in flipped]
        scalar = chosen[0][1]  # minus a quaternion is the same turn
        chosen = [(i, sign * scalar) for i, sign in chosen]
        columns = [present[i] if sign > 0.0 else flip(present[i]) for i, sign in chosen]
        new = dcm_from_quaternion(np.stack([sign * quaternion[:, i] for i, sign in chosen], axis=-1))
        value = rpy_from_dcm(_EAST @ new * _LEFT if east else new)
        changes: list[tuple[str, str, Any]] = [(table, "columns", columns)] if columns != present else []
        changes += [(table, "frame", "enu" if east else "geodetic")] if other_frame else []
        axes = "forward, left, up in east, north, up" if east else "forward, starboard, down in north, east, down"
        what = f"the quaternion of the reference (scalar, x, y, z) is {shown(columns)}"
        what += f", of axes {axes}" if other_frame else ""
        yield Reading("reference.attitude", ("reference.attitude",),
                       with_series("reference.attitude", value=value), number, what, tuple(changes))  # fmt: skip
