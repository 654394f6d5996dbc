"""The block form of the ideal samples against the form for one sample, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.compiled import Array, kernel
from simnav.geometry.rotation import dcm_from_rpy
from simnav.inverse_strapdown import BLOCK, increments, sample_from_motion, small_matrix
from simnav.kernel_types import Matrix, Stack, Vector


@kernel
def one_by_one(time: Vector, velocity: Matrix, dcm: Stack, memory: Vector, position: Matrix, samples: Matrix) -> None:
    """`increments` by `sample_from_motion`: positions, and (n, 6) angular rates and specific forces."""
    for k in range(time.size - 1):
        v, w, c, d = velocity[k], velocity[k + 1], dcm[k], dcm[k + 1]
        out = sample_from_motion(
            position[k, 0],
            position[k, 2],
            (v[0], v[1], v[2]),
            (w[0], w[1], w[2]),
            small_matrix(c),
            small_matrix(d),
            memory,
            time[k + 1] - time[k],
        )
        for i in range(3):
            samples[k, i], samples[k, 3 + i] = out.angular_rate[i], out.specific_force[i]
            position[k + 1, i] = position[k, i] + out.displacement[i]


def voyage(n: int, interval: float, turning: float) -> tuple[Array, Array, Array]:
    """Irregular times, velocities and attitudes of a ship in a seaway."""
    rng = np.random.default_rng(n)
    t = np.concatenate([[0.0], np.cumsum(interval * rng.uniform(0.5, 1.5, n))])
    v = np.stack([5.0 * np.sin(t / 7.0) + 4.0, 3.0 * np.cos(t / 5.0), np.sin(t)], axis=1)
    return t, v, turning * np.stack([0.3 * np.sin(t), 0.2 * np.cos(t), t / 10.0], axis=1)


@pytest.mark.parametrize(
    ("n", "interval", "turning", "latitude"),
    [
        (1, 0.01, 1.0, 0.7),
        (BLOCK - 1, 0.01, 1.0, 0.7),
        (BLOCK, 0.01, 1.0, -0.7),
        (3 * BLOCK + 5, 0.01, 1.0, 0.7),
        # Turns by up to a radian in an interval
        (2 * BLOCK + 1, 0.1, 8.0, 0.7),
        # 30 km in a block: the first guess of the steps to the next latitude is not right
        (2 * BLOCK + 1, 60.0, 0.01, 0.7),
        # At the pole the north-east-down axes themselves turn fast.
        (2 * BLOCK + 1, 0.1, 0.1, 1.5707955),
    ],
)
def test_a_block_has_the_bits_of_its_samples(n: int, interval: float, turning: float, latitude: float) -> None:
    time, velocity, attitude = voyage(n, interval, turning)
    position, samples = np.zeros((n + 1, 3)), np.empty((n, 6))
    position[0] = latitude, 0.3, 4.0
    memory, expected = np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.3]), np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.3])
    found, positions = increments(time, position[0].copy(), velocity, attitude, memory=memory)
    one_by_one(time, velocity, dcm_from_rpy(attitude), expected, position, samples)
    np.testing.assert_array_equal(found.angular_rate, samples[:, :3])
    np.testing.assert_array_equal(found.specific_force, samples[:, 3:])
    np.testing.assert_array_equal(positions, position)
    np.testing.assert_array_equal(memory, expected)
    assert np.isfinite(samples).all()
