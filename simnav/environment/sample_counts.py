"""How many samples of an instrument may come in one step: the places of an observation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from simnav.types import KINDS

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["Places", "most_samples", "places_of"]


@dataclass(frozen=True)
class Places:
    """The places for the samples of a step, of any run of a scenario.

    Attributes
    ----------
    most : dict of str to int
        For ``imu`` and each aiding instrument the largest number of samples.
    widths : dict of str to int
        For each aiding instrument the number of components of a reading.
    sides : dict of str to int
        For each instrument with channels the number of components of the side information.
    """

    most: dict[str, int]
    widths: dict[str, int]
    sides: dict[str, int]


def places_of(possible: Sequence[Scenario]) -> Places:
    """The places for all runs of a scenario, from what it may become (`simnav.scenario.Scenario.extremes`).

    Raises
    ------
    ValueError
        If the channels of an instrument are not the same in all runs.
    """
    counts = [most_samples(s) for s in possible]
    channels: dict[str, tuple[str, ...]] = {}
    widths: dict[str, int] = {}
    sides: dict[str, int] = {}
    for s in possible:
        for name, sheet in s.instruments_sheet().items():
            widths[name] = len(KINDS[sheet.kind].values)
            if channels.setdefault(name, sheet.channels) != sheet.channels:
                raise ValueError(
                    f"scenario {s.id}: the channels of {name!r} differ from run to run, and each needs a fixed slot"
                )
            if sheet.channels:
                sides[name] = len(KINDS[sheet.kind].side)
    return Places({name: max(m.get(name, 0) for m in counts) for m in counts for name in m}, widths, sides)


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
