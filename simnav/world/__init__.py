"""The world: the motion of a vessel by manoeuvres, sea and current, and the samples of ideal instruments on it."""

from __future__ import annotations

from typing import Annotated

from simnav.spec import OneOf
from simnav.world.bathymetry import Bathymetry
from simnav.world.current import Current
from simnav.world.hulls import Ship, Uuv
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
from simnav.world.manoeuvring.auv import Auv
from simnav.world.manoeuvring.ferry import Ferry
from simnav.world.manoeuvring.hull import Hull, Superstructure
from simnav.world.manoeuvring.surface_drone import SurfaceDrone
from simnav.world.manoeuvring.survey_ship import SurveyShip
from simnav.world.manoeuvring.vessel import ManoeuvringVessel
from simnav.world.manoeuvring.workboat import Workboat
from simnav.world.obstacles import Obstacle, Obstacles
from simnav.world.sea import Sea
from simnav.world.smooth_track import Limits, Poses, SmoothTrack
from simnav.world.sound_speed import SoundSpeedProfile
from simnav.world.start import Start
from simnav.world.surroundings import (
    SURROUNDINGS,
    FlatBottom,
    Surroundings,
    SurroundingSpec,
    register_surrounding,
)
from simnav.world.trajectory import SampledTrajectory, Steered, Trajectory, Voyage, WorldBlock
from simnav.world.vessel import VESSELS, KinematicVessel, Vessel, register_vessel
from simnav.world.water_column import WaterColumn
from simnav.world.water_level import WaterLevel
from simnav.world.waypoint_track import TrackVessel, WaypointTrack
from simnav.world.wind import AirFlow, Wind
from simnav.world.world import World

#: Any registered vessel; its ``kind`` decides the class.
AnyVessel = Annotated[Vessel, OneOf(lambda: list(VESSELS.items().values()), default="ship")]
#: Any registered part of the surroundings; its ``kind`` decides the class.
AnySurrounding = Annotated[SurroundingSpec, OneOf(lambda: list(SURROUNDINGS.items().values()))]

__all__ = [
    "SURROUNDINGS",
    "VESSELS",
    "Accelerate",
    "AirFlow",
    "AnySurrounding",
    "AnyVessel",
    "Auv",
    "Bathymetry",
    "Current",
    "Dive",
    "Ferry",
    "FlatBottom",
    "Hold",
    "Hull",
    "KinematicVessel",
    "LawnMower",
    "Limits",
    "Manoeuvre",
    "ManoeuvringVessel",
    "Obstacle",
    "Obstacles",
    "Poses",
    "SampledTrajectory",
    "Sea",
    "Ship",
    "SmoothTrack",
    "SoundSpeedProfile",
    "Start",
    "Steered",
    "Superstructure",
    "Surface",
    "SurfaceDrone",
    "SurroundingSpec",
    "Surroundings",
    "SurveyShip",
    "TrackVessel",
    "Trajectory",
    "Turn",
    "Uuv",
    "Vessel",
    "Voyage",
    "WaterColumn",
    "WaterLevel",
    "WaypointTrack",
    "Waypoints",
    "Wind",
    "Workboat",
    "World",
    "WorldBlock",
    "ZigZag",
    "register_surrounding",
    "register_vessel",
]
