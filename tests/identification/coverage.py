"""How often do the intervals of `simnav log identify` hold the true values? On simulated logs, whose errors are known.

    python -m tests.identification.coverage --runs 24

Each log is a voyage of 300 s in a zigzag, whose instruments have other errors than their datasheets say, drawn by the
seed: white noise, coloured fixes, a DVL with scale, bias, mounting and lever arm that are wrong, a late DVL, a biased
compass, an IMU that is noisier, and a heading at the start that is off. The datasheets are those of `TOLD`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from simnav.leaderboard.identification.report import Identification, identify
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.scenario.reading import parse
from simnav.source import record
from simnav.types import Array

__all__ = ["TOLD", "main", "simulated"]

TOLD = """
name = "identified-voyage"
version = 1
title = "a voyage whose datasheets are wrong"
duration_s = 300.0

[start]
latitude_deg = 50.0
longitude_deg = 4.0
speed_m_s = 4.0

[initial_error]
position_m = [1.0, 1.0, 2.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [0.2, 0.2, 1.5]

[vessel]
kind = "ship"
turn_rate_deg_s = 3.0

[[manoeuvre]]
kind = "zigzag"
angle_deg = 40.0
duration_s = 300.0

[sea]
significant_height_m = 0.8
peak_period_s = 6.0
direction_deg = 70.0

[instruments.imu]
rate_hz = 50.0

[instruments.imu.gyroscope]
bias_deg_h = 3.0
random_walk_deg_sqrt_h = 0.1

[instruments.imu.accelerometer]
bias_ug = 300.0
random_walk_ug_sqrt_hz = 60.0

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [1.0, 1.0, 2.0]
lever_arm_m = [-2.0, 0.0, -8.0]

[instruments.dvl]
rate_hz = 1.0
phase_s = 0.3
sigma_m_s = [0.02, 0.02, 0.02]
lever_arm_m = [1.0, 0.0, 3.0]

[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.3
"""

#: Table of the delays among the estimates.
_LOG = "log.instruments"


def simulated(seed: int) -> tuple[Scenario, Recording, dict[tuple[str, str], float]]:
    """A log, its scenario with the datasheets, and the true values by key and part."""
    told = parse(TOLD, source="told")
    rng = np.random.default_rng([58, seed])
    true: dict[tuple[str, str], float] = {}
    table: dict[str, Any] = told.to_toml()
    sheets = table["instruments"]

    def put(path: str, key: str, parts: tuple[str, ...], values: Any) -> None:
        for part, value in zip(parts, np.atleast_1d(values), strict=True):
            true[f"{path}.{key}", part] = float(value)

    def times(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    plane, axes = ("horizontal", "vertical"), ("forward", "starboard", "down")
    white, slow = times(0.2, 0.8) * np.array([1.0, 1.6]), times(0.8, 2.5) * np.array([1.0, 1.6])
    time = times(8.0, 40.0)
    sheets["gnss"] |= {"sigma_m": [white[0], *white], "bias_instability_m": [slow[0], *slow]}
    sheets["gnss"]["correlation_time_s"] = time
    put("instruments.gnss", "sigma_m", plane, white)
    put("instruments.gnss", "bias_instability_m", plane, slow)
    put("instruments.gnss", "correlation_time_s", ("",), time)
    noise, turn, arm = times(0.005, 0.05), rng.normal(0.0, 1.5, 3), np.array([1.0, 0.0, 3.0]) + rng.normal(0.0, 0.3, 3)
    bias, scale, late = rng.normal(0.0, 0.02, 3), rng.normal(0.0, 1.0), rng.normal(0.0, 0.1)
    sheets["dvl"] |= {
        "sigma_m_s": [noise] * 3, "fixed_bias_m_s": bias.tolist(), "fixed_scale_percent": scale,
        "fixed_misalignment_deg": turn.tolist(), "lever_arm_m": arm.tolist(),
        "timing": {"fixed_offset_s": late, "stated": False},
    }  # fmt: skip
    put("instruments.dvl", "sigma_m_s", plane, [noise, noise])
    put("instruments.dvl", "bias_m_s", axes, bias)
    put("instruments.dvl", "scale_percent", ("",), scale)
    put("instruments.dvl", "misalignment_deg", axes, turn)
    put("instruments.dvl", "lever_arm_m", axes, arm)
    put(f"{_LOG}.dvl", "offset_s", ("",), -late)
    put("instruments.gnss", "lever_arm_m", axes, [-2.0, 0.0, -8.0])
    put(f"{_LOG}.gnss", "offset_s", ("",), 0.0)
    put(f"{_LOG}.gyrocompass", "offset_s", ("",), 0.0)
    compass, off = times(0.1, 1.0), rng.normal(0.0, 1.0)
    sheets["gyrocompass"] |= {"sigma_deg": compass, "fixed_bias_deg": off}
    put("instruments.gyrocompass", "sigma_deg", ("",), compass)
    put("instruments.gyrocompass", "bias_deg", ("",), off)
    gyro, force = times(0.1, 0.6), times(60.0, 400.0)
    turning, pull = rng.normal(0.0, 5.0, 3), rng.normal(0.0, 400.0, 3)
    triads = sheets["imu"]["gyroscope"], sheets["imu"]["accelerometer"]
    triads[0].update(bias_deg_h=0.0, fixed_bias_deg_h=turning.tolist(), random_walk_deg_sqrt_h=gyro)
    triads[1].update(bias_ug=0.0, fixed_bias_ug=pull.tolist(), random_walk_ug_sqrt_hz=force)
    put("instruments.imu.gyroscope", "bias_deg_h", axes, turning)
    put("instruments.imu.gyroscope", "random_walk_deg_sqrt_h", ("",), gyro)
    put("instruments.imu.accelerometer", "bias_ug", axes, pull)
    put("instruments.imu.accelerometer", "random_walk_ug_sqrt_hz", ("",), force)
    recording = record(Scenario.from_toml(table, source="true"), seed)
    recording = replace(recording, instruments=told.instruments_sheet(), actual=None)
    heading = recording.initial_truth.attitude[0, 2] - recording.start.attitude[2]
    put("initial_error", "attitude_deg", ("error of the heading",), np.degrees(heading))
    return told, recording, true


def _compared(found: Identification, true: dict[tuple[str, str], float]) -> Iterator[tuple[str, float, bool, float]]:
    """Label, whether the log tells it, whether the interval holds the truth, and the error in half intervals."""
    for e in found.estimates:
        value = true.get((e.key, e.part), 0.0)  # an error that the instrument has not
        if value == 0.0 and not e.constant:
            error = np.nan
        elif e.constant:
            error = 2.0 * (value - e.value) / (e.high - e.low)
        else:
            error = 2.0 * np.log(value / e.value) / np.log(e.high / e.low)
        yield e.label, e.told, bool(e.low <= value <= e.high), float(error)


def main(arguments: list[str] | None = None) -> None:
    """Fit simulated logs, and count."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--runs", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    rows: dict[str, list[Array]] = {}
    missing = 0
    for seed in range(chosen.seed, chosen.seed + chosen.runs):
        told, recording, true = simulated(seed)
        compared = list(_compared(identify(told, recording), true))
        missing += len(true) - len(compared)
        for label, *fit in compared:
            rows.setdefault(label, []).append(np.array(fit, dtype=np.float64))
        outside = [f"{label} ({error:+.1f})" for label, _, inside, error in compared if not inside]
        print(f"seed {seed}: {len(compared)} figures, outside: {', '.join(outside) or 'none'}", flush=True)
    print(f"\n{'figure':58s} fits told inside  mean error in half intervals")
    for label, fits in rows.items():
        known, inside, error = np.array(fits).T
        print(f"{label:58s} {len(fits):4d} {known.sum():4.0f} {inside.mean():6.2f}  {np.nanmean(error):+.2f}")
    known, inside, _ = np.concatenate([np.array(fits) for fits in rows.values()]).T
    print(f"all: {inside.mean():.3f} of {len(inside)}; told by the log: {inside[known == 1.0].mean():.3f} of "
          f"{known.sum():.0f}; figures that were not found: {missing}")  # fmt: skip


if __name__ == "__main__":
    main()
