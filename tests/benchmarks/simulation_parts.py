"""What a simulated IMU sample costs, part by part, in nanoseconds of processor time.

``python -m tests.benchmarks.simulation_parts`` simulates the IMU of some scenarios again and again. The least time of
each part counts, so that other work on the machine disturbs little.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any
from unittest import mock

from simnav.normal_variates import NormalVariates
from simnav.scenario import Scenario, load
from simnav.sensors.imu import Imu
from simnav.simulation import simulator
from simnav.world import World

#: With waves and turns, with waves, without waves.
SCENARIOS = "coastal-voyage", "open-sea", "gnss-noise-step"
SECONDS, ROUNDS = 1200.0, 20


def only_imu(name: str) -> Scenario:
    """The first part of a scenario with its IMU, and without faults."""
    scenario = load(name)
    instruments = {name: scenario.instruments[name] for name in ("imu", "gnss")}
    return scenario.model_copy(
        update={"duration": min(SECONDS, scenario.duration), "instruments": instruments, "faults": ()}
    )


def timed(function: Callable[..., Any], spent: list[int]) -> Callable[..., Any]:
    """The function, which adds the nanoseconds that it took to a list of one number."""

    def run(*args: Any, **more: Any) -> Any:
        begin = time.process_time_ns()
        result = function(*args, **more)
        spent[0] += time.process_time_ns() - begin
        return result

    return run


def parts(scenario: Scenario) -> dict[str, float]:
    """Nanoseconds a sample of each part; a part within another one counts in both."""
    every = {
        "motion of the vessel, ideal samples": (World, "advance"),
        "errors of the IMU": (Imu, "sense"),
        "  of these random numbers": (NormalVariates, "fill"),
        "the whole simulation": (simulator, "simulate"),
    }
    samples = len(simulator.simulate(scenario, 0).data.imu)  # type: ignore[arg-type]
    least = dict.fromkeys(every, float("inf"))
    for name, (owner, function) in every.items():  # one at a time: the clock itself takes time
        for _ in range(ROUNDS):
            spent = [0]
            with mock.patch.object(owner, function, timed(getattr(owner, function), spent)):
                simulator.simulate(scenario, 1)
            least[name] = min(least[name], spent[0] / samples)
    return least


if __name__ == "__main__":
    for scenario in SCENARIOS:
        print(scenario)
        for name, cost in parts(only_imu(scenario)).items():
            print(f"  {name:36s} {cost:7.1f} ns")
