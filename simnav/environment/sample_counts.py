"""How many samples of an instrument may come in one step: the places of an observation."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["most_samples"]


def most_samples(scenario: Scenario) -> dict[str, int]:
    """The largest number of samples in one step, for each instrument and for ``imu``; each channel counts."""
    instruments, step = scenario.instruments_sheet(), scenario.step
    rates = {name: sheet.rate for name, sheet in instruments.items()}
    if clash := {"imu", "interval"} & set(rates):
        raise ValueError(f"scenario {scenario.id}: {clash.pop()!r} is no name for an aiding instrument")
    if instruments.imu is not None:
        rates = {"imu": instruments.imu.rate, **rates}
    most = {name: max(1, math.ceil(rate * step - 1e-6)) for name, rate in rates.items()}
    if scenario.recorded:  # real instruments are late, and then deliver several at once; the IMU is on a grid
        most = {name: k if name == "imu" else 2 * k + 1 for name, k in most.items()}
    for name, spec in scenario.aids.items():
        spread = spec.latency_spread()
        if spread is not None:  # what was delayed by up to the spread, and what was not, may come in one step
            most[name] = max(most[name], math.ceil(spec.rate * (step + spread)) + 1)
    for name, sheet in instruments.items():
        most[name] *= max(1, len(sheet.channels))
    return most
