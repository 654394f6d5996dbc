"""The equation for one reading of a kind whose equation is written for many."""

from __future__ import annotations

import numpy as np

from simnav.kinds import Datasheet, NavigationPoint, NavigationPoints, Observations
from simnav.types import Array

__all__ = ["single_reading"]


def single_reading(
    observations: Observations, point: NavigationPoint, sheet: Datasheet
) -> tuple[Array, dict[str, Array]]:
    """What an equation for many readings gives for one: an `Observation` by way of `Observations`.

    Parameters
    ----------
    observations : callable
        The equation.
    point : NavigationPoint
        The state, with the channel and the side information of the reading.
    sheet : Datasheet
        Of the instrument.
    """
    blocks = {name: values[None] for name, values in point.blocks.items()}
    channel = sheet.channels.index(point.channel) if point.channel else 0
    points = NavigationPoints(
        np.array([point.time]), point.position[None], point.velocity[None], point.dcm[None], point.angular_rate[None],
        blocks, np.array([channel]), point.side[None],
    )  # fmt: skip
    reading, given = observations(points, sheet)
    return reading[0], {name: block[0] for name, block in given.items()}
