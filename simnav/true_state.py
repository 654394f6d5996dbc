"""The true state of a vessel at which an instrument measures, as a structure (`simnav.structures`).

`simnav.world.motion` computes it, and `simnav.sensors.observation` reads it.
"""

from __future__ import annotations

from simnav.structures import length, structure

__all__ = ["TRUE_NUMBERS", "TRUE_STATE"]

#: Latitude, longitude [rad], height [m]; velocity, north-east-down [m/s]; roll, pitch, yaw [rad]; angular rate relative
#: to the Earth, in body axes [rad/s]; velocity of the water, north-east-down [m/s].
TRUE_STATE = structure(position=3, velocity=3, attitude=3, angular_rate=3, water=3)
#: Length of an array that holds it.
TRUE_NUMBERS = length(TRUE_STATE)
