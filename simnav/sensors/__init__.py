"""The instruments of a vessel, their errors and their faults.

`InstrumentSpec` and `FaultSpec` are the unions of all aiding instruments and of all faults, told apart by ``kind``;
the IMU is an `ImuSpec`. ``spec.datasheet(...)`` is what an estimator is told, ``spec.build(...)`` the instrument of one
run, and ``sense`` measures the truth block by block.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from simnav.sensors.compass import Gyrocompass, MagneticCompass
from simnav.sensors.depth import Depth
from simnav.sensors.dvl import Dvl
from simnav.sensors.faults import FaultLayer, FaultSpec, build_layers, check_faults, labels
from simnav.sensors.gnss import GnssPosition, GnssVelocity
from simnav.sensors.imu import Imu, ImuSpec
from simnav.sensors.instrument import AidSpec, Instrument
from simnav.sensors.speed_log import SpeedLog
from simnav.sensors.terrain import TerrainFix

__all__ = [
    "AidSpec",
    "Depth",
    "Dvl",
    "FaultLayer",
    "FaultSpec",
    "GnssPosition",
    "GnssVelocity",
    "Gyrocompass",
    "Imu",
    "ImuSpec",
    "Instrument",
    "InstrumentSpec",
    "MagneticCompass",
    "SpeedLog",
    "TerrainFix",
    "build_layers",
    "check_faults",
    "labels",
]

#: Any aiding instrument; ``kind`` tells which.
InstrumentSpec = Annotated[
    GnssPosition | GnssVelocity | Dvl | MagneticCompass | Gyrocompass | SpeedLog | Depth | TerrainFix,
    Field(discriminator="kind"),
]
