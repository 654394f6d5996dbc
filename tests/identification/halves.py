"""Does an error model that was fitted on one half of a recording hold on the other half, and on other recordings?

    python -m tests.identification.halves auv-akit --others 5

The scenario is fitted on the first half of recording 0. Then `ekf` (`ship-ekf` without an IMU) runs over the whole
recordings, with the scenario's datasheets and with those of the fit. Of recording 0 only the second half counts.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.stats import chi2

from simnav.estimator import make
from simnav.geometry.earth import relative_position
from simnav.leaderboard.identification.report import identify
from simnav.scenario import Scenario, load
from simnav.source import record
from simnav.trial import run_trial

__all__ = ["horizontal", "main"]


def horizontal(scenario: Scenario, seed: int, since: float) -> list[tuple[float, float, float]]:
    """Of horizontal position and velocity: RMSE [m], [m/s], NEES over its expectation, share in the 95 % region."""
    recording = record(scenario, seed)
    trial = run_trial(make("ekf" if recording.instruments.imu is not None else "ship-ekf"), recording)
    truth = recording.data.truth
    late = truth.time > since
    assert trial.covariance is not None
    found = []
    for first, error in (
        (0, relative_position(trial.position, truth.position)),
        (3, trial.velocity - truth.velocity),
    ):
        error, part = error[late, :2], slice(first, first + 2)
        nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(trial.covariance[late, part, part]), error)
        known = np.isfinite(nees)
        rmse = float(np.sqrt(np.mean(np.sum(error[known] ** 2, axis=1))))
        found.append((rmse, float(nees[known].mean()) / 2.0, float(np.mean(nees[known] < chi2.ppf(0.95, 2)))))
    return found


def main(arguments: list[str] | None = None) -> None:
    """Fit one half, and compare on the other."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("scenario")
    parser.add_argument("--others", type=int, default=0, help="further recordings, as a whole")
    chosen = parser.parse_args(arguments)
    before = load(chosen.scenario)
    half = 0.5 * before.duration
    found = identify(before, record(before, 0), half)
    print(found.toml)
    after = Scenario.from_toml(found.table, source="fitted")
    print("recording               RMSE before, after   NEES/2 before, after   in the 95 % region before, after")
    for seed in range(chosen.others + 1):
        pairs = [horizontal(s, seed, half if seed == 0 else 0.0) for s in (before, after)]
        for name, first, second in zip(("position", "velocity"), *pairs, strict=True):
            figures = "   ".join(f"{a:8.3g} {b:8.3g}   " for a, b in zip(first, second, strict=True))
            print(f"{seed:9d} {name}   {figures}", flush=True)


if __name__ == "__main__":
    main()
