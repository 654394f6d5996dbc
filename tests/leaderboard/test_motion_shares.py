"""The parts of a speed's fast error: sizes that were put in are found, and no variance is lost when it is split."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.leaderboard.identification.motion_shares import SPEED, TURN_RATE_DEG_S, MotionShares, motion_shares
from simnav.scenario.residuals import ErrorSeries
from simnav.types import TapStates

KEY = "sigma_m_s"


def voyage(seed: int, constant: float, with_speed: float, in_turns: float, n: int = 4000) -> ErrorSeries:
    """White errors of one component on a course with turns of 12 deg/s."""
    rng = np.random.default_rng(seed)
    time = np.arange(n, dtype=np.float64)
    speed = 1.5 + np.sin(time / 50.0)
    turn = np.where(np.sin(time / 30.0) > 0.7, 12.0, 0.0)
    sigma = np.sqrt(
        constant**2 + (with_speed * speed / SPEED) ** 2 + (in_turns * speed / SPEED * turn / TURN_RATE_DEG_S) ** 2
    )
    zeros = np.zeros((n, 3))
    velocity, rate = zeros.copy(), zeros.copy()
    velocity[:, 0], rate[:, 2] = speed, np.radians(turn)
    taps = TapStates(time, zeros, velocity, zeros, rate, zeros)
    return ErrorSeries(str(seed), time, (sigma * rng.standard_normal(n))[:, None], 1.0, float(n), taps)


def sizes(shares: MotionShares, sigma: float) -> list[float]:
    """The sizes of the parts of white noise."""
    parts = (shares.constant, shares.with_speed, shares.in_turns)
    return [sigma * np.sqrt(part.share) / part.motion for part in parts]


@pytest.mark.parametrize("told", [(0.01, 0.0, 0.0), (0.0, 0.005, 0.0), (0.0, 0.004, 0.012), (0.006, 0.003, 0.02)])
def test_the_parts_are_found(told: tuple[float, float, float]):
    series = [voyage(k, *told) for k in range(4)]
    found = motion_shares(series)
    assert found is not None
    sigma = float(np.sqrt(np.mean(np.concatenate([s.error for s in series]) ** 2)))
    np.testing.assert_allclose(sizes(found[0], sigma), told, atol=0.15 * max(told))
    assert found[0].freedom > 15.0


def test_heavy_tails_are_those_beyond_the_motion():
    series = voyage(1, 0.01, 0.0, 0.0)
    tails = np.random.default_rng(2).standard_t(3.0, series.error.shape)
    found = motion_shares([ErrorSeries("t", series.time, 0.01 * tails, 1.0, series.duration, series.taps)])
    assert found is not None
    assert 2.0 < found[0].freedom < 6.0


def test_no_variance_is_lost():
    """White noise, an error that alternates and a slow one: their mean squares over the log stay."""
    series = [voyage(k, 0.0, 0.004, 0.012) for k in range(2)]
    (shares,) = motion_shares(series) or [None]
    assert shares is not None
    processes = [
        {"kind": "white", KEY: 0.01},
        {"kind": "gauss_markov_2", KEY: 0.005, "period_s": 2.2, "damping": 0.2},
        {"kind": "gauss_markov", KEY: 0.02, "correlation_time_s": 30.0},
    ]
    made = shares.split(processes, KEY)
    taps = series[0].taps
    assert taps is not None
    speed, turn = np.linalg.norm(taps.velocity, axis=1) / SPEED, np.degrees(taps.angular_rate[:, 2]) / TURN_RATE_DEG_S

    def mean_square(process: dict) -> float:
        size, names = process[KEY], process.get("proportional_to", {})
        if isinstance(size, dict):  # drawn between two sizes, log-uniform
            low, high = size["log_uniform"]
            size = np.sqrt((high**2 - low**2) / (2.0 * np.log(high / low)))
        factor = (speed if "speed_m_s" in names else 1.0) * (turn if "turn_rate_deg_s" in names else 1.0)
        return float(size**2 * np.mean(np.square(factor)))

    assert made[-1] == processes[-1]
    assert sum(map(mean_square, made[:-1])) == pytest.approx(0.01**2 + 0.005**2, rel=0.03)
    turning = [p for p in made if "turn_rate_deg_s" in p.get("proportional_to", {})]
    assert {p["kind"] for p in turning} <= {"white", "heavy_tailed", "gauss_markov_2"}
    assert "gauss_markov_2" in {p["kind"] for p in turning}


def test_without_the_motion_nothing_is_split():
    series = voyage(1, 0.01, 0.0, 0.0)
    assert motion_shares([ErrorSeries("n", series.time, series.error, 1.0, series.duration)]) is None
