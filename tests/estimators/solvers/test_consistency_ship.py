"""Ship filters and their window over 50 seeds on ships that move as their model supposes: ANEES in its 95 % band.

The truth is the motion of `simnav.estimators.models.ship` driven by its noise, integrated here ten times a second and
from random states: speed a random walk, turn rate and current Gauss-Markov, sideways velocity white. The instruments
are those of the catalogue's ships, with constant biases and scale factor drawn from the datasheet. In the catalogue
ships keep their course and speed better than that, and the filters are less sure of their velocity than they could be.
"""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.models.ship import ShipModel
from simnav.geometry import earth, rotation
from simnav.recording import AidStream, Block, Recording
from simnav.types import Datasheet, InitialState, Instruments, NavigationStates

SEEDS = 50
DT, EVERY = 0.1, 10  # of the truth [s]; samples between two measurements
DEG = np.pi / 180.0
#: filterpy's filter takes 4 ms an epoch, and 50 are enough to see that it does as ``ship-ukf``.
FILTERS = {"ship-ekf": 160, "ship-ukf": 160, "ship-ckf": 160, "filterpy-ukf": 50, "ship-fgo": 160}
SHEETS = (
    Datasheet("gnss", "gnss_position", 1.0, np.array([4.0, 4.0, 8.0])),
    Datasheet("compass", "gyrocompass", 1.0, np.array([0.5 * DEG]), bias=np.array([0.5 * DEG])),
    Datasheet("log", "speed_log", 1.0, np.array([0.1]), bias=np.array([0.1]), scale=0.01),
)
SIGMAS = np.array([5.0, 5.0, 5.0, 0.2, 0.2, 0.2, DEG, DEG, DEG])
GROUPS = {"position": [0, 1], "velocity": [2, 3], "heading": [4], "biases": [5, 6, 7]}
Run = tuple[Recording, np.ndarray]


def voyages(model: ShipModel, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Geodetic positions (T, ships, 3) and speed, heading, north and east current (T, ships, 4)."""
    rng = np.random.default_rng(2)
    size = round(duration / DT) + 1
    u, psi = np.full(SEEDS, 6.0), rng.uniform(-np.pi, np.pi, SEEDS)
    r, c = model.turn_rate * rng.standard_normal(SEEDS), model.current * rng.standard_normal((2, SEEDS))
    a, b = np.exp(-DT / model.turn_time), np.exp(-DT / model.current_time)
    position = np.tile([0.7, 0.2, 0.0], (SEEDS, 1))
    positions, states = np.empty((size, SEEDS, 3)), np.empty((size, SEEDS, 4))
    for k in range(size):
        positions[k], states[k] = position, np.stack([u, psi, *c], axis=1)
        middle = psi + 0.5 * DT * r
        step = DT * np.stack([u * np.cos(middle) + c[0], u * np.sin(middle) + c[1], np.zeros(SEEDS)], axis=1)
        position = earth.displace(position, step)
        psi = psi + DT * r
        u = u + model.acceleration * np.sqrt(DT) * rng.standard_normal(SEEDS)
        r = a * r + model.turn_rate * np.sqrt(1 - a * a) * rng.standard_normal(SEEDS)
        c = b * c + model.current * np.sqrt(1 - b * b) * rng.standard_normal((2, SEEDS))
    return positions, states


def sail(seed: int, position: np.ndarray, state: np.ndarray, sway: float) -> Run:
    """The recording of one ship, and its biases: compass, log and the log's scale factor."""
    rng = np.random.default_rng([seed, 2])
    n = len(state)
    u, psi, *current = state.T
    sideways = sway * rng.standard_normal(n)
    velocity, attitude = np.zeros((n, 3)), np.zeros((n, 3))
    velocity[:, 0] = u * np.cos(psi) - sideways * np.sin(psi) + current[0]
    velocity[:, 1] = u * np.sin(psi) + sideways * np.cos(psi) + current[1]
    attitude[:, 2] = rotation.wrap_angle(psi)
    time, at = DT * np.arange(n), np.arange(EVERY, n, EVERY)
    compass, log, scale = np.array([0.5 * DEG, 0.1, 0.01]) * rng.standard_normal(3)
    noise = {s.name: s.sigma * rng.standard_normal((len(at), len(s.sigma))) for s in SHEETS}
    values = {
        "gnss": earth.displace(position[at], noise["gnss"]),
        "compass": rotation.wrap_angle(psi[at, None] + compass + noise["compass"]),
        "log": (1.0 + scale) * u[at, None] + log + noise["log"],
    }
    streams = {
        s.name: AidStream(
            s.name, s.kind, time[at], values[s.name], np.zeros(len(at), np.uint32), np.zeros_like(noise[s.name]),
            np.zeros_like(noise[s.name]) + s.sigma, np.empty(0),
        )
        for s in SHEETS
    }  # fmt: skip
    e = SIGMAS * rng.standard_normal(9)
    start = InitialState(
        0.0, earth.displace(position[0], e[:3]), velocity[0] + e[3:6], attitude[0] + [0.0, 0.0, e[8]],
        np.diag(SIGMAS**2),
    )  # fmt: skip
    truth = NavigationStates(time, position, velocity, attitude)
    block = Block(0.0, float(time[-1]), None, None, streams, truth[EVERY::EVERY])
    recording = Recording("stochastic-v1", seed, Instruments(SHEETS), truth[:1], start, (), block)
    return recording, np.array([compass, log, scale])


@pytest.fixture(scope="module")
def fleet() -> list[Run]:
    model = ShipModel()
    positions, states = voyages(model, max(FILTERS.values()))
    return [sail(seed, positions[:, seed], states[:, seed], model.sway) for seed in range(SEEDS)]


@pytest.fixture(scope="module", params=FILTERS)
def errors(request, fleet) -> tuple[np.ndarray, np.ndarray]:
    """Errors (seeds, T, 8) of position, velocity, heading and biases, and their covariances; none across velocity."""
    every, covariances = [], []
    for recording, biases in fleet:
        estimator = make(request.param)
        estimator.reset(recording.start, recording.instruments)
        model = estimator.chain.front if request.param == "ship-fgo" else estimator.model
        truth = recording.data.truth
        own = [model.bias_at["compass"], model.bias_at["log"], model.scale_at["log"]]
        for k, packet in zip(range(FILTERS[request.param]), recording.steps()):
            estimate = estimator.update(packet)
            P = estimator.kf.P if request.param == "filterpy-ukf" else estimator.covariance
            every.append([
                *earth.relative_position(estimate.position, truth.position[k])[:2],
                *(estimate.velocity - truth.velocity[k])[:2],
                rotation.wrap_angle(estimate.attitude[2] - truth.attitude[k, 2]),
                *(model.x[own] - biases),
            ])  # fmt: skip
            covariance = np.zeros((8, 8))
            covariance[:5, :5] = estimate.covariance[np.ix_([0, 1, 3, 4, 8], [0, 1, 3, 4, 8])]
            covariance[5:, 5:] = P[np.ix_(own, own)]
            covariances.append(covariance)
    return np.reshape(every, (SEEDS, -1, 8)), np.reshape(covariances, (SEEDS, -1, 8, 8))


@pytest.mark.parametrize("group", GROUPS)
def test_ship_filters(errors, assert_consistent, group: str):
    e, P = errors
    at = GROUPS[group]
    assert_consistent(e[..., at], P[..., at, :][..., at])
