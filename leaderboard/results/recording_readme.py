"""What stands beside the files of an exported recording: ``README.md`` for people, ``start.json`` for programs."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.spec import UNITS
from simnav.types import COMPONENTS, KINDS

from .hidden import NO_SEED, has_truth

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["readme", "start_of", "start_text"]

_SIGMA_UNITS = [("m", 1.0)] * 3 + [("m/s", 1.0)] * 3 + [("deg", UNITS["deg"])] * 3

_ESTIMATES = (
    "A CSV file with a header: `time_s`, and what was estimated of `latitude_deg`, `longitude_deg`, `height_m`, "
    "`velocity_north_m_s`, `velocity_east_m_s`, `velocity_down_m_s`, `roll_deg`, `pitch_deg`, `yaw_deg`. Standard "
    "deviations, if there are any: `sigma_north_m`, `sigma_east_m`, `sigma_down_m`, `sigma_velocity_north_m_s` and so "
    "on, `sigma_attitude_north_deg` and so on. The estimate of an epoch uses measurements until its time only."
)


def start_of(recording: Recording) -> dict[str, Any]:
    """Start, covariance and datasheets, in SI units and radians, plain.

    Without infinity, which JSON does not have: null.
    """
    start, instruments = recording.start, recording.instruments
    imu = instruments.imu
    content: dict[str, Any] = {
        "scenario": recording.scenario,
        "units": "SI, radians; position: latitude, longitude, height; velocity: north, east, down; attitude: roll, "
        "pitch, yaw; covariance: errors north, east, down [m], velocity [m/s], attitude about north, east, down [rad]",
        "duration": recording.duration,
        "step": instruments.step,
        "start": {name: getattr(start, name) for name in ("time", "position", "velocity", "attitude", "covariance")},
        "imu": None
        if imu is None
        else {"rate": imu.rate, "gyroscope": vars(imu.gyroscope), "accelerometer": vars(imu.accelerometer)},
        "instruments": {
            s.name: {
                "kind": s.kind,
                "components": list(KINDS[s.kind].values),
                **{
                    name: getattr(s, name)
                    for name in ("rate", "sigma", "bias", "bias_instability", "correlation_time", "scale", "lever_arm")
                },
                "details": dict(s.details),
                "channels": list(s.channels),
                **({} if s.timing is None else {"timing": vars(s.timing)}),
            }
            for s in instruments.values()
        },
    }
    if recording.seed != NO_SEED:
        content |= {"seed": recording.seed, "draws": dict(recording.draws)}
    if has_truth(recording):
        content["faults"] = [vars(f) for f in recording.faults]
    plain: dict[str, Any] = _plain(content)
    return plain


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (str, int, bool, type(None))) else str(value)


def readme(recording: Recording, ending: str = "csv") -> str:
    """The text of ``README.md``, beside files with this ending."""
    start, instruments = recording.start, recording.instruments
    seed = "not told" if recording.seed == NO_SEED else str(recording.seed)
    sigma = np.sqrt(np.diag(start.covariance))
    latitude, longitude = np.degrees(start.position[:2])
    roll, pitch, yaw = np.degrees(start.attitude)
    lines = [
        f"# {recording.scenario}",
        "",
        f"A run of {recording.duration:g} s, seed {seed}, written by simnav. An estimate is wanted every "
        f"{instruments.step:g} s, from {instruments.step:g} s on.",
        "",
        "| file | rows | columns |",
        "|---|---|---|",
    ]
    if recording.data.imu is not None:
        lines.append(
            f"| `imu.{ending}` | {len(recording.data.imu)} | mean angular rate and specific force over the interval "
            "that ends at the time; axes forward, starboard, down |"
        )
    for name, s in recording.data.aids.items():
        kind = KINDS[s.kind]
        columns = ", ".join(f"{c.name} [{c.unit}]" for c in kind.components)
        if s.has_clock:
            columns += "; the time is the stamp, and the reading arrives at `arrival_s`"
        lines.append(f"| `{name}.{ending}` | {len(s)} | {kind.quantity}: {columns} |")
    if has_truth(recording):
        lines.append(f"| `truth.{ending}` | {len(recording.data.truth)} | the true states at the ends of the steps |")
    lines += [
        "| `start.json` | | start, covariance and datasheets for programs, in SI units and radians |",
        "",
        "Columns end in their unit; angles are in degrees. Times are seconds since the start of the run.",
        "",
        "## Start",
        "",
        f"- position: latitude {latitude:.9f} deg, longitude {longitude:.9f} deg, height {start.position[2]:.3f} m",
        f"- velocity north, east, down: {', '.join(f'{v:.4f}' for v in start.velocity)} m/s",
        f"- roll, pitch, yaw: {roll:.4f}, {pitch:.4f}, {yaw:.4f} deg",
        "- standard deviations of its errors: "
        + ", ".join(
            f"{name} {value / scale:.4g} {unit}"
            for name, value, (unit, scale) in zip(COMPONENTS, sigma, _SIGMA_UNITS, strict=True)
        ),
        "",
        "## Datasheets",
        "",
    ]  # fmt: skip
    if instruments.imu is not None:
        lines.append(f"- IMU: {instruments.imu.rate:g} Hz; figures in `start.json`")
    for sheet in instruments.values():
        kind = KINDS[sheet.kind]
        figures = ", ".join(
            f"{c.error} {v / UNITS.get(c.error_unit, 1.0):.4g} {c.error_unit}"
            for c, v in zip(kind.components, np.atleast_1d(sheet.sigma), strict=False)
        )
        arm = ", ".join(f"{x:g}" for x in sheet.lever_arm)
        lines.append(f"- {sheet.name} ({sheet.kind}): {sheet.rate:g} Hz; sigma {figures}; lever arm {arm} m")
    lines += ["", "## Estimates", "", _ESTIMATES, ""]
    if recording.seed == NO_SEED:
        lines.append(
            "Return them as `NAME/FOLDER.csv`, with the name of your estimator and that of this folder, which ends in "
            "the number of the run."
        )
    else:
        lines.append(f"`simnav score SCENARIO --seed {recording.seed} FILE` scores them.")
    if has_truth(recording):
        lines += ["", "## Faults", ""]
        lines += [
            f"- {f.kind} of {', '.join(f.instruments)} from {f.start:g} to {f.end:g} s" for f in recording.faults
        ] or ["- none"]
    return "\n".join(lines) + "\n"


def start_text(recording: Recording) -> str:
    """The text of ``start.json``."""
    return json.dumps(start_of(recording), indent=1, allow_nan=False) + "\n"
