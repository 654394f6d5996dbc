"""Faults: composable layers over the streams of instruments, simulated or real, with their labels.

`build_layers` makes the layers of a run and `labels` the truth about them; the bits of both agree.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Annotated

from pydantic import Field

from simnav.recording import FaultLabel
from simnav.sensors.faults.additive import BiasStep, GrossError, Multipath, NoiseStep, Ramp
from simnav.sensors.faults.fault import FaultLayer, quantity_of
from simnav.sensors.faults.fault import FaultSpec as AnyFault
from simnav.sensors.faults.imu_disturbance import ImuDisturbance
from simnav.sensors.faults.replacing import FalseZero, Frozen, Outage
from simnav.spec import SpecError

__all__ = [
    "AnyFault",
    "BiasStep",
    "FalseZero",
    "FaultLayer",
    "FaultSpec",
    "Frozen",
    "GrossError",
    "ImuDisturbance",
    "Multipath",
    "NoiseStep",
    "Outage",
    "Ramp",
    "build_layers",
    "check_faults",
    "labels",
    "quantity_of",
]

#: Any fault; ``kind`` tells which.
FaultSpec = Annotated[
    NoiseStep | Outage | GrossError | Multipath | Ramp | Frozen | BiasStep | FalseZero | ImuDisturbance,
    Field(discriminator="kind"),
]

_BITS = 32


def check_faults(faults: Sequence[AnyFault], instruments: Mapping[str, str], *, imu: bool = True) -> None:
    """Check that faults fit a scenario.

    Parameters
    ----------
    faults : sequence of FaultSpec
    instruments : mapping
        Name of each aiding instrument to its kind.
    imu : bool
        Whether there is an IMU.

    Raises
    ------
    SpecError
        On the first that does not, or if together they have more than 32 intervals.
    """
    for fault in faults:
        fault.check(instruments, imu=imu)
    total = sum(fault.bits for fault in faults)
    if total > _BITS:
        raise SpecError(f"the faults have {total} intervals in all; a recording can label {_BITS}")


def build_layers(faults: Sequence[AnyFault], seed: int) -> tuple[FaultLayer, ...]:
    """The layers of a run, to be applied in this order.

    Parameters
    ----------
    faults : sequence of FaultSpec
    seed : int

    Returns
    -------
    tuple of FaultLayer
        Their bits are those of `labels`. The random streams of a fault are named by it and not by its place, so
        that adding another one leaves it as it was.
    """
    layers, bit = [], 0
    seen: Counter[str] = Counter()
    for fault in faults:
        key = fault.stream_name
        layers.append(fault.build(bit, seed, seen[key]))
        seen[key] += 1
        bit += fault.bits
    return tuple(layers)


def labels(faults: Sequence[AnyFault], duration: float, instruments: Mapping[str, str]) -> tuple[FaultLabel, ...]:
    """The truth about the faults of a run: label j belongs to bit j.

    Parameters
    ----------
    faults : sequence of FaultSpec
    duration : float
        Of the run [s].
    instruments : mapping
        Name to kind.
    """
    return tuple(label for fault in faults for label in fault.label(duration, instruments))
