"""The world: the motion of a vessel by manoeuvres, sea and current, and the samples of ideal instruments on it."""

from __future__ import annotations

from simnav.world.current import Current
from simnav.world.manoeuvres import (
    Accelerate,
    Dive,
    Hold,
    LawnMower,
    Manoeuvre,
    Surface,
    Turn,
    Waypoints,
    ZigZag,
)
from simnav.world.sea import Sea
from simnav.world.vessel import Start, Vessel
from simnav.world.world import World, WorldBlock

__all__ = [
    "Accelerate",
    "Current",
    "Dive",
    "Hold",
    "LawnMower",
    "Manoeuvre",
    "Sea",
    "Start",
    "Surface",
    "Turn",
    "Vessel",
    "Waypoints",
    "World",
    "WorldBlock",
    "ZigZag",
]
