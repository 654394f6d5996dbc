"""The instruments of a vessel, their errors and their faults.

Every aiding instrument has a specification (an `AidSpec`), and so has every fault (a `FaultSpec`); the IMU has an
`ImuSpec`. ``spec.datasheet(...)`` is the datasheet that an estimator receives, ``spec.build(...)`` makes the instrument
of one run, and ``sense`` measures the truth block by block. Kinds of third parties are registered in the same way as
those of simnav: `register_instrument`, `register_fault`.
"""

from __future__ import annotations

from typing import Annotated

from simnav.kinds import INSTRUMENTS
from simnav.sensors.acoustic_range import AcousticRange
from simnav.sensors.altimeter import Altimeter
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.compass import Gyrocompass, MagneticCompass
from simnav.sensors.depth import Depth
from simnav.sensors.derived import DerivedInstrument
from simnav.sensors.dvl import Dvl
from simnav.sensors.dvl_beams import DvlBeams
from simnav.sensors.dvl_solution import DvlSolution
from simnav.sensors.dvl_water_solution import DvlWaterSolution
from simnav.sensors.faults import AnyFault, FaultLayer, FaultSpec, build_layers, fault_specs, labels, register_fault
from simnav.sensors.gnss import GnssPosition, GnssVelocity
from simnav.sensors.gnss_raw import GnssRaw
from simnav.sensors.gnss_receiver import GnssReceiver, GnssReceiverVelocity
from simnav.sensors.imu import Imu, ImuSpec
from simnav.sensors.instrument import AidSpec, Instrument, register_instrument
from simnav.sensors.magnetic_field import MagneticField
from simnav.sensors.multibeam_profile import MultibeamProfile
from simnav.sensors.speed_log import SpeedLog
from simnav.sensors.terrain import TerrainFix
from simnav.sensors.terrain_match import TerrainMatch
from simnav.sensors.usbl_fix import UsblFix
from simnav.sensors.vessel_range import VesselRange
from simnav.spec import OneOf

__all__ = [
    "AcousticRange",
    "AidSpec",
    "Altimeter",
    "AnyFault",
    "AnyInstrument",
    "ChannelInstrument",
    "Depth",
    "DerivedInstrument",
    "Dvl",
    "DvlBeams",
    "DvlSolution",
    "DvlWaterSolution",
    "FaultLayer",
    "FaultSpec",
    "GnssPosition",
    "GnssRaw",
    "GnssReceiver",
    "GnssReceiverVelocity",
    "GnssVelocity",
    "Gyrocompass",
    "Imu",
    "ImuSpec",
    "Instrument",
    "MagneticCompass",
    "MagneticField",
    "MultibeamProfile",
    "SpeedLog",
    "TerrainFix",
    "TerrainMatch",
    "UsblFix",
    "VesselRange",
    "build_layers",
    "fault_specs",
    "instrument_specs",
    "labels",
    "register_fault",
    "register_instrument",
]


def instrument_specs() -> list[type[AidSpec]]:
    """The specifications of all registered kinds of aiding instruments."""
    return list(INSTRUMENTS.items().values())


def _specs() -> list[type[AidSpec | ImuSpec]]:
    return [*instrument_specs(), ImuSpec]


#: Any registered instrument, including the IMU; its ``kind`` decides the class.
AnyInstrument = Annotated[AidSpec | ImuSpec, OneOf(_specs)]
