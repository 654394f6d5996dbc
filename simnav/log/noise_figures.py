"""Noise figures for a datasheet, from a log: what is left against the reference, and an IMU's stillest stretches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simnav.kinds import KINDS
from simnav.log.alignment import Alignment
from simnav.log.channel import list_recordings
from simnav.log.imu_series import ImuSeries, read_imu
from simnav.spec import UNITS

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["Figure", "noise_figures"]

#: Length of a stretch [s], and the share of the stillest ones that is used.
_STRETCH, _SHARE = 5.0, 0.02


@dataclass(frozen=True)
class Figure:
    """A figure of a datasheet.

    Attributes
    ----------
    key : str
        Key in the scenario, like ``instruments.gnss.sigma_m``.
    value, now : float or tuple of float
        What the log says, and what the scenario says, in the unit of the key.
    basis : str
        Where it comes from, and in which direction it may be wrong.
    """

    key: str
    value: tuple[float, ...]
    now: tuple[float, ...]
    basis: str


def noise_figures(scenario: Scenario, aligned: Sequence[Alignment], seed: int = 0) -> list[Figure]:
    """Figures for the datasheets of a log.

    Parameters
    ----------
    scenario : Scenario
        With a ``[log]``.
    aligned : sequence of Alignment
        The instruments, compared with the reference (`simnav.log.alignment.align`).
    seed : int
        Number of the recording.

    Returns
    -------
    list of Figure
    """
    found = []
    for one in aligned:
        if not one.residual:
            continue
        components = KINDS[scenario.aids[one.instrument].kind].components
        unit = components[0].error_unit
        scale = UNITS.get(unit, 1.0)
        found.append(
            Figure(
                f"instruments.{one.instrument}.sigma_{unit}",
                tuple(v / scale for v in one.residual.values()),
                tuple(one.datasheet[n] / scale for n in one.residual),
                f"robust scatter of {one.rows} readings about the reference, whose own error is in it",
            )
        )
    log = scenario.log
    sheet = scenario.instruments_sheet().imu
    if log is not None and log.imu is not None and sheet is not None:
        names = list_recordings(log)
        found += _of_imu(read_imu(log, log.imu, names[seed % len(names)]), sheet.gyroscope.random_walk,
                         sheet.accelerometer.random_walk)  # fmt: skip
    return found


def _of_imu(imu: ImuSeries, gyroscope: float, accelerometer: float) -> list[Figure]:
    """White noise densities: of the stillest stretches the difference of neighbouring samples."""
    interval = float(np.median(np.diff(imu.edge)))
    length = max(16, round(_STRETCH / interval))
    count = len(imu.mean) // length
    if count < 2:
        return []
    stretches = imu.mean[: count * length].reshape(count, length, 6)
    # By differences of neighbours, slow motion and biases drop out (Allan deviation at the shortest averaging time).
    noise = np.sqrt(0.5 * np.mean(np.diff(stretches, axis=1) ** 2, axis=1))
    used = max(2, round(_SHARE * count))
    densities = [
        float(np.mean(np.sort(noise[:, part].mean(axis=1))[:used])) * np.sqrt(interval)
        for part in (slice(0, 3), slice(3, 6))
    ]
    basis = (
        f"the {used} stillest of {count} stretches of {length * interval:.3g} s; vibration is in it, and an IMU that "
        "filters its samples has more"
    )
    units = (
        ("gyroscope.random_walk_deg_sqrt_h", "deg_sqrt_h", gyroscope),
        ("accelerometer.random_walk_ug_sqrt_hz", "ug_sqrt_hz", accelerometer),
    )
    return [
        Figure(f"instruments.imu.{key}", (density / UNITS[unit],), (now / UNITS[unit],), basis)
        for (key, unit, now), density in zip(units, densities, strict=True)
    ]
