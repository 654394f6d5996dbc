"""Simulated scenarios that stand for all others: what any of the catalogue uses, one of these uses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from simnav.scenario import Scenario

__all__ = ["OF_EVERY_SORT", "used"]

OF_EVERY_SORT = (
    "auv-akit-twin",
    "auv-and-ship",
    "auv-gyroscope-bias-step",
    "coastal-voyage",
    "coloured-fixes",
    "depth-in-the-tide",
    "dive-to-the-bottom",
    "dvl-in-bubbles",
    "fluxgate-deviation",
    "following-sea",
    "glider-dive",
    "gnss-spoofing",
    "gyrocompass-at-sea",
    "imu-clipping",
    "imu-dropouts",
    "imu-stuck-axis",
    "imu-vibration",
    "imu-warm-up",
    "late-aids",
    "lawnmower-beams",
    "open-sea",
    "random-harbours",
    "satellites-fjord",
    "satellites-jamming",
    "satellites-open-sea",
    "satellites-spoofing",
    "survey-without-bottom-lock",
    "terrain-flat",
    "terrain-matching",
    "terrain-rough",
    "training-poor-imu-faults",
    "training-ships",
    "under-ice-transit",
    "unsynchronised-clocks",
    "usbl-inspection",
    "uuv-surface",
    "window-bias",
    "wrong-datasheet",
    "wrong-start",
)


def used(scenario: Scenario) -> set[str]:
    """The fields that a scenario sets, below the kind of what they belong to: vessel, instrument, fault or process."""
    return set(_fields(scenario.model_dump(mode="json", exclude_defaults=True), ""))


def _fields(value: Any, path: str) -> Iterator[str]:
    if isinstance(value, Mapping):
        path = f"{path}={value['kind']}" if isinstance(value.get("kind"), str) else path
        yield path
        for key, part in value.items():
            own = path == "/instruments"  # the keys are names that a scenario chose
            yield from _fields(part, f"{path}/{part.get('kind', 'imu') if own else key}")
    elif isinstance(value, list):
        for part in value:
            yield from _fields(part, path)
    else:
        yield path
