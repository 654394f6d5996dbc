"""Faults: composable layers over the streams of instruments, simulated or real, with their labels.

`build_layers` makes the layers of a run, and `labels` makes the labels of the faults. Both use the same bits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Annotated

from simnav.labels import FaultLabel
from simnav.sensors.faults.additive import AdditiveLayer, BiasStep, GrossError, Multipath, NoiseStep, Ramp
from simnav.sensors.faults.clock_step import ClockStep
from simnav.sensors.faults.fault import FAULTS, Effect, FaultError, FaultSpec, Names, effect_of, register_fault
from simnav.sensors.faults.imu_disturbance import ImuDisturbance
from simnav.sensors.faults.imu_dropout import ImuDropout
from simnav.sensors.faults.imu_faults import ImuBiasStep, ImuClipping
from simnav.sensors.faults.imu_stuck_axis import ImuStuckAxis
from simnav.sensors.faults.imu_vibration import ImuVibration
from simnav.sensors.faults.imu_warm_up import ImuWarmUp
from simnav.sensors.faults.layer import Activity, FaultLayer
from simnav.sensors.faults.replacing import FalseZero, Frozen, Outage, ReplacingLayer
from simnav.sensors.faults.satellite_signals import Jamming, Spoofing
from simnav.sensors.faults.sizes import Size, size_by_component, size_range
from simnav.spec import OneOf

__all__ = [
    "FAULTS",
    "Activity",
    "AdditiveLayer",
    "AnyFault",
    "BiasStep",
    "ClockStep",
    "Effect",
    "FalseZero",
    "FaultError",
    "FaultLayer",
    "FaultSpec",
    "Frozen",
    "GrossError",
    "ImuBiasStep",
    "ImuClipping",
    "ImuDisturbance",
    "ImuDropout",
    "ImuStuckAxis",
    "ImuVibration",
    "ImuWarmUp",
    "Jamming",
    "Multipath",
    "Names",
    "NoiseStep",
    "Outage",
    "Ramp",
    "ReplacingLayer",
    "Size",
    "Spoofing",
    "build_layers",
    "effect_of",
    "fault_specs",
    "labels",
    "register_fault",
    "size_by_component",
    "size_range",
]


def fault_specs() -> list[type[FaultSpec]]:
    """The specifications of all registered kinds of faults."""
    return list(FAULTS.items().values())


#: Any registered fault; its ``kind`` decides the class.
AnyFault = Annotated[FaultSpec, OneOf(fault_specs)]


def build_layers(faults: Sequence[FaultSpec], seed: int) -> tuple[FaultLayer, ...]:
    """The layers of a run, to be applied in this order.

    Parameters
    ----------
    faults : sequence of FaultSpec
        The faults of the scenario, in its order.
    seed : int
        Seed of the run.

    Returns
    -------
    tuple of FaultLayer
        One layer for each fault, with the bits of `labels`. The random streams of a fault are named after the fault and
        not after its position in the list, so that an additional fault does not change it.
    """
    layers, bit = [], 0
    seen: Counter[str] = Counter()
    for fault in faults:
        key = fault.stream_name
        layer = fault.build(bit, seed, seen[key])
        if not isinstance(layer, FaultLayer):
            raise FaultError(
                f"fault {fault.kind!r}: build() returned {type(layer).__name__}, where a FaultLayer is wanted"
            )
        layers.append(layer)
        seen[key] += 1
        bit += fault.bits
    return tuple(sorted(layers, key=lambda layer: layer.last))  # stable


def labels(faults: Sequence[FaultSpec], duration: float, instruments: Mapping[str, str]) -> tuple[FaultLabel, ...]:
    """The labels of the faults of a run: label j belongs to bit j.

    Parameters
    ----------
    faults : sequence of FaultSpec
        The faults of the scenario, in its order.
    duration : float
        Length of the run [s].
    instruments : mapping
        The kind of each instrument, by its name.
    """
    return tuple(label for fault in faults for label in fault.label(duration, instruments))
