"""The current: a set, a drift and a shear with depth."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from simnav.spec import NonNegative, Spec, quantity

__all__ = ["Current"]


class Current(Spec):
    """A steady current whose speed falls linearly with depth, to nothing and no further.

    Attributes
    ----------
    speed : float
        At the surface [m/s].
    direction : float
        Towards which it flows, from north over east [rad].
    shear : float
        Loss of speed per metre of depth [1/s].
    """

    speed: NonNegative = quantity("m_s", 0.0)
    direction: Annotated[float, Field(ge=-6.2832, le=6.2832)] = quantity("deg", 0.0)
    shear: NonNegative = quantity("per_s", 0.0)
