"""Random clean voyages: do estimators that have the same information agree?

A voyage takes 240 s and has no fault. Drawn are the vessel (ship, boat, AUV, ROV), the grade of the IMU (MEMS to
navigation grade), how well the initial heading is known, the rates of DVL (1 to 25 Hz) and GNSS (0.2 to 10 Hz), lever
arms, sea and latitude. ::

    python -m tests.agreement.voyages run RESULTS.jsonl --count 200 --first 31000 --estimators ekf,ukf,sw-fgo
    python -m tests.agreement.voyages run RESULTS.jsonl --family clean-voyages --count 200 --first 0
    python -m tests.agreement.voyages run RESULTS.jsonl --count 40 --first 32000 --heading-off 90
    python -m tests.agreement.voyages table RESULTS.jsonl

With ``--family`` voyage k is run k of a family of scenarios, such as ``scenarios/families/clean-voyages.toml``. A
second call of ``run`` goes on where the first one was stopped, and adds estimators that are missing. The table gives,
for each estimator, the horizontal RMSE over the best of the estimators in `BEST_OF`, or of those of ``--over``, on the
same voyage: median, geometric mean, 90th percentile with a 95 % interval, and maximum; how often the mean horizontal
NEES by degree of freedom is above 5, and in how many of these the estimator never reports that it is inconsistent; and
the processor time of an epoch.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import simnav
from simnav.estimator import make
from simnav.geometry.rotation import wrap_angle
from simnav.recording import Recording
from simnav.scenario import load, parse

__all__ = ["BEST_OF", "run", "turned", "voyage", "voyage_of"]

DURATION = 240.0
#: The error of an estimator is divided by the least one among these.
BEST_OF = ("ekf", "iekf", "ukf", "inekf", "sw-fgo", "gnc-fgo", "huber-fgo")
#: A mean NEES by degree of freedom above this is a divergence.
LARGEST_NEES = 5.0
_KEPT = (
    "horizontal_rmse", "heading_rmse", "nees_horizontal", "nees_attitude", "smoothed_horizontal_rmse", "inconsistent",
    "inconsistent_end",
)  # fmt: skip
SPEEDS = {"ship": (3.0, 10.0), "auv": (1.0, 2.5), "rov": (0.2, 1.0), "boat": (5.0, 20.0)}


def voyage(number: int, lowest_heading: float = 0.1, highest_heading: float = 45.0) -> tuple[str, dict[str, Any]]:
    """The TOML of a voyage, and what was drawn for it.

    Parameters
    ----------
    number : int
        Seed of the draws.
    lowest_heading, highest_heading : float
        Between which the sigma of the initial heading is drawn, log-uniformly [deg].
    """
    g = np.random.default_rng(number)

    def log_uniform(low: float, high: float) -> float:
        return float(np.exp(g.uniform(np.log(low), np.log(high))))

    def arm(size: float) -> str:
        return "[" + ", ".join(f"{g.uniform(-size, size):.2f}" for _ in range(3)) + "]"

    vessel = str(g.choice(list(SPEEDS)))
    under_water = vessel in ("auv", "rov")
    grade = log_uniform(1e-3, 1.0)  # 1: MEMS
    heading = log_uniform(lowest_heading, highest_heading)
    tilt = min(5.0, 0.05 + heading / 8.0)
    dvl, gnss, sigma = log_uniform(1.0, 25.0), log_uniform(0.2, 10.0), log_uniform(0.02, 5.0)
    speed = float(g.uniform(*SPEEDS[vessel]))
    lines = [
        f'name = "voyage-{number}"',
        "version = 1",
        f'title = "Random voyage {number}"',
        f"duration_s = {DURATION}",
        "[start]",
        f"latitude_deg = {g.uniform(-75.0, 75.0):.4f}",
        f"longitude_deg = {g.uniform(-179.0, 179.0):.4f}",
        f"heading_deg = {g.uniform(0.0, 360.0):.2f}",
        f"speed_m_s = {speed:.3f}",
        *([f"depth_m = {g.uniform(1.0, 60.0):.1f}"] if under_water else []),
        "[initial_error]",
        "position_m = [2.0, 2.0, 1.0]",
        "velocity_m_s = [0.1, 0.1, 0.1]",
        f"attitude_deg = [{tilt:.3f}, {tilt:.3f}, {heading:.3f}]",
        "[vessel]",
        f'kind = "{"uuv" if under_water else "ship"}"',
        f"turn_rate_deg_s = {g.uniform(1.0, 8.0):.2f}",
        "[[manoeuvre]]",
        'kind = "hold"',
        f"duration_s = {g.uniform(20.0, 60.0):.1f}",
        "[[manoeuvre]]",
        'kind = "zigzag"',
        f"angle_deg = {g.uniform(10.0, 60.0):.1f}",
        "duration_s = 150.0",
    ]
    if g.random() < 0.6:
        lines += [
            "[sea]",
            f"significant_height_m = {log_uniform(0.2, 4.0):.2f}",
            f"peak_period_s = {g.uniform(4.0, 12.0):.1f}",
            f"direction_deg = {g.uniform(0.0, 360.0):.0f}",
        ]
    lines += [
        "[instruments.imu]",
        "rate_hz = 100.0",
        "[instruments.imu.gyroscope]",
        f"bias_deg_h = {1000.0 * grade:.4f}",
        f"bias_instability_deg_h = {50.0 * grade:.5f}",
        "correlation_time_s = 600.0",
        f"random_walk_deg_sqrt_h = {grade:.6f}",
        "[instruments.imu.accelerometer]",
        f"bias_ug = {70000.0 * grade:.3f}",
        f"bias_instability_ug = {300.0 * grade:.4f}",
        "correlation_time_s = 600.0",
        f"random_walk_ug_sqrt_hz = {1000.0 * grade:.4f}",
        "[instruments.dvl]",
        f"rate_hz = {dvl:.3f}",
        f"sigma_m_s = {log_uniform(0.005, 0.1):.4f}",
        f"scale_percent = {log_uniform(0.05, 1.0):.3f}",
        f"misalignment_deg = {log_uniform(0.05, 2.0):.3f}",
        f"lever_arm_m = {arm(3.0)}",
        "[instruments.gnss]",
        'kind = "gnss_position"',
        f"rate_hz = {gnss:.3f}",
        f"sigma_m = [{sigma:.3f}, {sigma:.3f}, {2.0 * sigma:.3f}]",
        f"lever_arm_m = {arm(5.0)}",
    ]
    if g.random() < 0.4:
        lines += [
            "[instruments.gyrocompass]",
            f"rate_hz = {log_uniform(0.5, 10.0):.2f}",
            "sigma_deg = 0.5",
            "bias_deg = 0.3",
        ]
    if under_water:
        lines += ["[instruments.depth]", f"rate_hz = {log_uniform(1.0, 10.0):.2f}", "sigma_m = 0.1"]
    drawn = {
        "number": number, "vessel": vessel, "grade": grade, "heading_deg": heading, "dvl_hz": dvl, "gnss_hz": gnss,
        "gnss_sigma_m": sigma, "speed_m_s": speed,
    }  # fmt: skip
    return "\n".join(lines), drawn


def voyage_of(
    family: str, number: int, heading: tuple[float, float] | None = None, duration: float | None = None
) -> tuple[Recording, dict[str, Any]]:
    """A voyage of a family of scenarios, and what was drawn for it.

    Parameters
    ----------
    family : str
    number : int
        Of the run.
    heading : (float, float), optional
        Another range of the sigma of the initial heading [deg].
    duration : float, optional
        The first seconds of the voyage only.
    """
    scenario = load(family)
    if heading is not None:
        scenario = scenario.with_values({"draw.heading": {"log_uniform": list(heading)}})
    if duration is not None:
        scenario = scenario.with_values({"duration_s": duration})
    recording = simnav.record(scenario, number)
    heading_deg = float(np.degrees(np.sqrt(recording.start.covariance[8, 8])))
    return recording, {"number": number, "heading_deg": heading_deg, "draws": dict(recording.draws)}


def turned(recording: Recording, off_deg: float) -> Recording:
    """The recording with an initial heading that is off by an angle, of which its sigma tells."""
    start, off = recording.start, np.radians(off_deg)
    attitude, covariance = start.attitude.copy(), start.covariance.copy()
    attitude[2] = wrap_angle(recording.initial_truth.attitude[0, 2] + off)
    covariance[8, 8] = off**2
    return replace(recording, start=replace(start, attitude=attitude, covariance=covariance))


def run(recording: Recording, estimator: str) -> dict[str, Any]:
    """The errors of an estimator, ``name`` or ``name:parameter=value``, on a voyage."""
    name, *given = estimator.split(":")
    parameters = dict(pair.split("=", 1) for pair in given)
    start = process_time()
    trial = simnav.run_trial(make(name, **parameters), recording)
    seconds = process_time() - start
    found: dict[str, Any] = {"status": trial.status, "milliseconds": 1e3 * seconds / max(len(trial), 1)}
    if len(trial):
        scores = simnav.score(trial, recording)
        found |= {k: float(scores[k]) for k in _KEPT if k in scores}
    return found


def _stored(paths: list[Path]) -> dict[int, dict[str, Any]]:
    """The voyages of files of results by number; what several lines hold of one voyage is joined."""
    voyages: dict[int, dict[str, Any]] = {}
    for path in paths:
        for line in path.read_text().splitlines() if path.exists() else ():
            row = json.loads(line)
            kept = voyages.setdefault(row["number"], row)
            kept["errors"] |= row["errors"]
    return voyages


def _run_all(arguments: argparse.Namespace) -> None:
    path: Path = arguments.results
    stored = _stored([path])
    for number in range(arguments.first, arguments.first + arguments.count):
        done = stored[number]["errors"] if number in stored else {}
        missing = [e for e in arguments.estimators.split(",") if e not in done]
        if not missing:
            continue
        if arguments.family:
            recording, row = voyage_of(arguments.family, number, arguments.heading, arguments.duration)
        else:
            toml, row = voyage(number, *(arguments.heading or (0.1, 45.0)))
            recording = simnav.record(parse(toml), number)
        row["heading_off_deg"] = arguments.heading_off
        if arguments.heading_off:
            recording = turned(recording, arguments.heading_off)
        row["errors"] = {e: run(recording, e) for e in missing}
        with path.open("a") as file:
            file.write(json.dumps(row) + "\n")


def percentile_interval(values: Sequence[float], share: float) -> tuple[float, float]:
    """95 % interval of a percentile, from the order statistics; infinite where there are too few values.

    Source: H. A. David and H. N. Nagaraja, *Order Statistics*, Wiley, 2003, section 7.1.

    Examples
    --------
    >>> percentile_interval(range(100), 0.9)
    (83, 95)
    """
    from scipy.stats import binom

    ordered = [-np.inf, *sorted(values), np.inf]
    below, above = (int(binom.ppf(q, len(values), share)) for q in (0.025, 0.975))
    return ordered[below], ordered[above + 1]


def _table(arguments: argparse.Namespace) -> None:
    rows = list(_stored(arguments.results).values())
    for low, high in ((0.0, 2.0), (2.0, 10.0), (10.0, 180.0), (0.0, 180.0)):
        some = [r for r in rows if low <= r["heading_deg"] < high]
        if not some:
            continue
        print(f"\ninitial heading known to {low:g} to {high:g} deg, {len(some)} voyages")
        print(
            f"{'estimator':30s}    n median   mean    p90 [    95 %    ]     max  (voyage)  NEES > {LARGEST_NEES:g}"
            "  silent  not ok  ms an epoch"
        )
        for name in dict.fromkeys(e for r in some for e in r["errors"]):
            ratios, numbers, high_nees, silent, failed, cost = [], [], 0, 0, 0, []
            for r in some:
                e = r["errors"]
                others = [
                    e[b]["horizontal_rmse"] for b in arguments.over.split(",") if b in e and e[b]["status"] == "ok"
                ]
                if name not in e or not others:
                    continue
                best = min(others)
                if e[name]["status"] != "ok":
                    failed += 1
                    continue
                ratios.append(e[name]["horizontal_rmse"] / best)
                numbers.append(r["number"])
                if e[name]["nees_horizontal"] > LARGEST_NEES:
                    high_nees += 1
                    silent += not e[name].get("inconsistent", 0.0) > 0.0
                cost.append(e[name]["milliseconds"])
            if not ratios:
                continue
            worst = int(np.argmax(ratios))
            low_90, high_90 = percentile_interval(ratios, 0.9)
            mean = np.exp(np.mean(np.log(ratios)))
            print(
                f"{name:30s} {len(ratios):4d} {np.median(ratios):6.3f} {mean:6.3f} {np.percentile(ratios, 90):6.3f}"
                f" [{low_90:6.3f}, {high_90:6.3f}] {ratios[worst]:7.2f}  ({numbers[worst]})  {high_nees:6d}"
                f"  {silent:7d}  {failed:6d}  {np.median(cost):8.2f}"
            )


def main() -> None:
    """The command of the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    runs = commands.add_parser("run", help="run estimators over voyages")
    runs.add_argument("results", type=Path)
    runs.add_argument("--first", type=int, default=31000, help="seed of the first voyage")
    runs.add_argument("--count", type=int, default=200)
    runs.add_argument("--family", default="", help="draw voyages from this family, like clean-voyages")
    runs.add_argument("--heading", type=float, nargs=2, help="range of its initial sigma [deg], 0.1 to 45")
    runs.add_argument("--duration", type=float, help="run the first seconds of a family's voyages only [s]")
    runs.add_argument("--heading-off", type=float, default=0.0, help="start off by this angle, and know it [deg]")
    runs.add_argument("--estimators", default=",".join(BEST_OF))
    runs.set_defaults(call=_run_all)
    table = commands.add_parser("table", help="print the table")
    table.add_argument("results", type=Path, nargs="+")
    table.add_argument("--over", default=",".join(BEST_OF), help="divide by the least error of these")
    table.set_defaults(call=_table)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    arguments.call(arguments)


if __name__ == "__main__":
    main()
