"""The EKF against KF-GINS, the GNSS/INS filter of the i2Nav Group, Wuhan University, on the same measurements.

KF-GINS is a C++ program with 21 error states (position, velocity, attitude, biases and scale factors of the IMU). Its
sources are at github.com/i2Nav-WHU/KF-GINS, and it is built there. This module writes the files that it reads, runs it
on the IMU and the position fixes of recordings, and compares its positions with those of ``ekf``. ::

    python -m tests.agreement.kf_gins --program KF-GINS --scenario open-sea --runs 10
    python -m tests.agreement.kf_gins --program KF-GINS --scenario car-kitti

All other instruments of the scenario are left out for both. KF-GINS models the biases as Gauss-Markov processes. They
are given a correlation time of a million hours, which makes them random walks as those of ``ekf``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from math import pi, sqrt
from pathlib import Path

import numpy as np

import simnav
from simnav.estimator import make
from simnav.geometry import earth
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.types import Array, TriadDatasheet

__all__ = ["compared", "imu_and_fixes", "kf_gins_positions", "write_input"]

_LONG = 1e6  # correlation time of the biases [h]
_DEGREE, _HOUR, _MGAL = pi / 180.0, 3600.0, 1e-5


def imu_and_fixes(scenario: Scenario) -> Scenario:
    """The scenario with its IMU and its position fixes only.

    Raises
    ------
    ValueError
        If it has no IMU ``imu`` or no receiver ``gnss``.
    """
    kept = {name: spec for name, spec in scenario.instruments.items() if name in ("imu", "gnss")}
    if len(kept) != 2:
        raise ValueError(f"{scenario.name}: an IMU 'imu' and a receiver 'gnss' are needed")
    return scenario.model_copy(update={"instruments": kept})


def _walk(sheet: TriadDatasheet) -> float:
    """Random walk of the bias [x/sqrt(s)].

    Raises
    ------
    ValueError
        If the in-run bias has a correlation time: KF-GINS has one state for it and the turn-on bias.
    """
    if sheet.bias_instability > 0.0 and np.isfinite(sheet.correlation_time):
        raise ValueError("bias_instability with a correlation time has no counterpart in KF-GINS")
    return float(np.hypot(sheet.rate_random_walk, sheet.bias_instability))


def write_input(recording: Recording, folder: Path) -> Path:
    """Write what KF-GINS reads, and return its configuration file.

    Parameters
    ----------
    recording : Recording
        With an IMU and ``gnss``.
    folder : Path
        Where the files are written, and where the results will be.
    """
    imu, start, fixes = recording.data.imu, recording.start, recording.data.aids["gnss"]
    assert imu is not None
    sheets, sheet = recording.instruments.imu, recording.instruments["gnss"]
    assert sheets is not None
    interval = imu.interval[:, None]
    rows = np.column_stack([imu.time, imu.angular_rate * interval, imu.specific_force * interval])
    # The first sample is that before the start, which it takes for the past; the last one is not processed.
    rows = np.vstack([np.r_[start.time, rows[0, 1:]], rows, np.r_[imu.time[-1] + 1.0, rows[-1, 1:]]])
    np.savetxt(folder / "imu.txt", rows, fmt="%.15g")
    sigma = np.broadcast_to(sheet.sigma, (3,))
    fix = np.column_stack(
        [fixes.time, np.degrees(fixes.value[:, :2]), fixes.value[:, 2], np.tile(sigma, (fixes.time.size, 1))]
    )
    np.savetxt(folder / "gnss.txt", fix[np.isfinite(fix).all(axis=1)], fmt="%.15g")
    first = np.sqrt(np.diag(start.covariance))
    gyroscope, accelerometer = sheets.gyroscope, sheets.accelerometer
    per_hour, scale = _DEGREE / _HOUR, 1e-6
    gauss_markov = sqrt(0.5 * _LONG * _HOUR)  # sigma of the process with the random walk 1

    def three(value: float) -> list[float]:
        return [float(value)] * 3

    configuration = {
        "imupath": str(folder / "imu.txt"),
        "gnsspath": str(folder / "gnss.txt"),
        "outputpath": str(folder),
        "imudatalen": 7,
        "imudatarate": round(sheets.rate),
        "starttime": float(start.time),
        "endtime": float(imu.time[-1]) + 0.5 / sheets.rate,
        "initpos": [*np.degrees(start.position[:2]).tolist(), float(start.position[2])],
        "initvel": start.velocity.tolist(),
        "initatt": np.degrees(start.attitude).tolist(),
        "initgyrbias": three(0.0),
        "initaccbias": three(0.0),
        "initgyrscale": three(0.0),
        "initaccscale": three(0.0),
        "initposstd": first[:3].tolist(),
        "initvelstd": first[3:6].tolist(),
        "initattstd": np.degrees(first[6:]).tolist(),
        "initbgstd": three(gyroscope.bias / per_hour),
        "initbastd": three(accelerometer.bias / _MGAL),
        "initsgstd": three(gyroscope.scale / scale),
        "initsastd": three(accelerometer.scale / scale),
        "imunoise": {
            "arw": three(gyroscope.random_walk / _DEGREE * 60.0),
            "vrw": three(accelerometer.random_walk * 60.0),
            "gbstd": three(_walk(gyroscope) * gauss_markov / per_hour),
            "abstd": three(_walk(accelerometer) * gauss_markov / _MGAL),
            "gsstd": three(0.0),
            "asstd": three(0.0),
            "corrtime": _LONG,
        },
        "antlever": np.asarray(sheet.lever_arm).tolist(),
    }
    path = folder / "kf-gins.yaml"
    path.write_text(json.dumps(configuration, indent=1))  # JSON is YAML
    return path


def kf_gins_positions(program: Path, recording: Recording, times: Array) -> Array:
    """Positions of KF-GINS: latitude, longitude [rad], height [m].

    Parameters
    ----------
    program : Path
        KF-GINS.
    recording : Recording
    times : (n,) array
        When; the last of its positions at or before these times is taken [s].

    Raises
    ------
    RuntimeError
        If the program fails.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        done = subprocess.run([program, write_input(recording, folder)], capture_output=True, text=True, check=False)
        results = folder / "KF_GINS_Navresult.nav"
        if done.returncode or not results.exists():
            raise RuntimeError(f"{program}: exit code {done.returncode}\n{done.stdout[-2000:]}")
        table = np.loadtxt(results)
    at = np.searchsorted(table[:, 1], times + 1e-6) - 1
    return np.column_stack([np.radians(table[at, 2:4]), table[at, 4]])


def compared(program: Path, recording: Recording) -> tuple[float, float, float]:
    """Horizontal RMSE of ``ekf`` and of KF-GINS, and the RMS of their difference [m], where the truth is known."""
    trial = simnav.run_trial(make("ekf"), recording)
    true = recording.data.truth.position[: len(trial)]
    known = np.isfinite(true).all(axis=1)
    ours, true = trial.position[known], true[known]
    theirs = kf_gins_positions(program, recording, trial.time[known])

    def rms(a: Array, b: Array) -> float:
        return float(np.sqrt(np.mean(np.sum(earth.relative_position(a, b)[:, :2] ** 2, axis=1))))

    return rms(ours, true), rms(theirs, true), rms(ours, theirs)


def main() -> None:
    """The command of the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, required=True, help="KF-GINS, built from its sources")
    parser.add_argument("--scenario", default="open-sea", help="its name or file")
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1000, help="of the first run")
    arguments = parser.parse_args()
    scenario = imu_and_fixes(load(arguments.scenario))
    print("| seed | ekf [m] | KF-GINS [m] | ratio | difference [m] |\n|---|---|---|---|---|")
    ratios = []
    for seed in range(arguments.seed, arguments.seed + arguments.runs):
        ours, theirs, apart = compared(arguments.program.resolve(), simnav.record(scenario, seed))
        ratios.append(ours / theirs)
        print(f"| {seed} | {ours:.4f} | {theirs:.4f} | {ours / theirs:.4f} | {apart:.4f} |", flush=True)
    print(f"\nRatio: geometric mean {np.exp(np.mean(np.log(ratios))):.4f}, {min(ratios):.4f} to {max(ratios):.4f}")


if __name__ == "__main__":
    main()
