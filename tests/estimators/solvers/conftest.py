"""What it takes to be consistent, for all solvers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from simnav.scoring import nees_band


def check(errors: np.ndarray, covariances: np.ndarray) -> None:
    """Errors (runs, epochs, d) are what their covariances say.

    The epochs of a run depend on each other (a constant bias: all of them), the runs do not. Therefore

    - over all epochs the mean NEES is in the 95 % band of one of them, which no correlation in time makes too narrow;
    - it is in the band (99.95 %, for there are many such tests) of as many independent samples as it has by the scatter
      of the runs' means over time: those of a gamma distribution of that scatter. Where the epochs of a run are nearly
      independent this is the sharper;
    - at four epochs far apart, the mean over the runs is in the band that holds with 95 % for all four of four groups
      of states (Bonferroni).
    """
    runs, epochs, d = errors.shape
    nees = np.mean(errors * np.linalg.solve(covariances, errors[..., None])[..., 0], axis=-1)
    each = nees.mean(axis=1)
    apart = nees[:, epochs * np.arange(1, 5) // 4 - 1].mean(axis=0)
    samples = int(2.0 * runs * each.mean() ** 2 / each.var(ddof=1))  # a gamma's variance is 2 mean^2 / degrees
    for value, band in (
        (each.mean(), nees_band(d, runs)),
        (each.mean(), nees_band(1, samples, 0.9995)),
        (apart, nees_band(d, runs, 1.0 - 0.05 / 16)),
    ):
        assert np.all((band[0] < value) & (value < band[1])), f"ANEES {value} is not within {band}"


@pytest.fixture(scope="session")
def assert_consistent() -> Callable[[np.ndarray, np.ndarray], None]:
    """`check`."""
    return check
