"""A family of training voyages: noise steps and multipath of GNSS, all sizes and times drawn.

No scenario of the catalogue is in it, and its seeds are those of training (`simnav.environment.seeds`) or of scoring,
never both. Of a seed are drawn, independently: the grade of the IMU, the sigma of the receiver, the vessel's speed and
manoeuvres, the sea; and of the faults whether they come at all, when, for how long, how large, and how fast multipath
changes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from simnav.scenario import Scenario
from simnav.streams import stream

__all__ = ["STEPS", "noise_and_multipath"]

#: Steps of a voyage, of one second each.
STEPS = 240


def noise_and_multipath(seed: int) -> Scenario:
    """The training voyage of a seed.

    Parameters
    ----------
    seed : int
        Of the run.

    Returns
    -------
    Scenario
        An IMU and a GNSS receiver; sizes are drawn uniformly in their logarithm: GNSS 0.5 to 3 m; the noise step is by
        2 to 20, for 20 to 120 s; multipath 2 to 20 m, with a correlation time of 5 to 100 s, for 20 to 150 s.
    """
    rng = stream(seed, "training voyage", "noise and multipath")

    def drawn(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    grade, sigma, speed = drawn(0.3, 10.0), drawn(0.5, 3.0), drawn(1.5, 12.0)
    turns: list[dict[str, Any]] = [
        {
            "kind": "turn",
            "angle_deg": float(rng.choice([-1.0, 1.0])) * drawn(20.0, 150.0),
            "rate_deg_s": drawn(0.7, 4.0),
        }
        for _ in range(4)
    ]
    holds: list[dict[str, Any]] = [{"kind": "hold", "duration_s": drawn(10.0, 60.0)} for _ in range(4)]
    faults: list[dict[str, Any]] = []
    for kind in ("noise_step", "multipath"):
        begin, length = float(rng.uniform(20.0, 160.0)), drawn(20.0, 120.0)
        factor, size, time = drawn(2.0, 20.0), drawn(2.0, 20.0), drawn(5.0, 100.0)
        if rng.random() < 0.2:
            continue
        fault: dict[str, Any] = {"kind": kind, "instruments": ["gnss"], "start_s": begin, "end_s": begin + length}
        if kind == "noise_step":
            fault["factor"] = factor
        else:
            fault |= {"sigma_m": [size, size, 1.5 * size], "correlation_time_s": time}
        faults.append(fault)
    table = {
        "name": "training-noise-and-multipath",
        "version": 1,
        "title": "Training: noise steps and multipath",
        "duration_s": float(STEPS),
        "start": {
            "latitude_deg": float(rng.uniform(-60.0, 60.0)), "longitude_deg": float(rng.uniform(-179.0, 179.0)),
            "heading_deg": float(rng.uniform(-180.0, 180.0)), "speed_m_s": speed,
        },
        "initial_error": {
            "position_m": [sigma, sigma, 1.5 * sigma], "velocity_m_s": 3 * [0.05], "attitude_deg": [0.1, 0.1, 1.0],
        },
        "vessel": {"speed_time_constant_s": 10.0, "turn_time_constant_s": 3.0, "turn_rate_deg_s": 4.0},
        "manoeuvre": [m for pair in zip(holds, turns, strict=True) for m in pair],
        "sea": {"significant_height_m": drawn(0.05, 1.5), "peak_period_s": drawn(2.0, 8.0)},
        "instruments": {
            "imu": {
                "rate_hz": 50.0,
                "gyroscope": {
                    "bias_deg_h": grade, "random_walk_deg_sqrt_h": 0.03 * grade,
                    "rate_random_walk_deg_h_sqrt_h": 0.3 * grade,
                },
                "accelerometer": {
                    "bias_ug": 50.0 * grade, "random_walk_ug_sqrt_hz": 20.0 * grade,
                    "rate_random_walk_ug_sqrt_s": 0.2 * grade,
                },
            },
            "gnss": {"kind": "gnss_position", "rate_hz": 1.0, "sigma_m": [sigma, sigma, 1.5 * sigma]},
        },
        "fault": faults,
    }  # fmt: skip
    return Scenario.from_toml(table, source="the training voyage")
