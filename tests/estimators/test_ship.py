"""The ship model: derivatives by finite differences, and consistency on ships that move as it supposes."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

from simnav.estimator import UnsuitableScenario
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.ship_points import ShipPoints
from simnav.estimators.rows.kalman import ShipEkf
from simnav.geometry import earth, rotation
from simnav.recording import AidStream, Block, Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import Datasheet, InitialState, Instruments, Measurement, NavigationStates

DEG = np.pi / 180.0

SHEETS = (
    Datasheet("gnss", "gnss_position", 1.0, np.full(3, 3.0), bias=np.ones(3), lever_arm=np.array([20.0, 3.0, -15.0])),
    Datasheet("velocity", "gnss_velocity", 1.0, np.full(3, 0.1), lever_arm=np.array([20.0, 3.0, 0.0])),
    Datasheet("dvl", "dvl", 1.0, np.full(3, 0.1), lever_arm=np.array([20.0, 3.0, 0.0])),
    Datasheet("compass", "gyrocompass", 1.0, np.full(1, 0.01), bias=np.full(1, 0.01)),
    Datasheet("log", "speed_log", 1.0, np.full(1, 0.1), bias=np.full(1, 0.1), scale=0.02,
              lever_arm=np.array([0.0, 2.0, 0.0])),
    Datasheet("terrain", "terrain_fix", 1.0, np.full(2, 3.0)),
)  # fmt: skip


@pytest.fixture
def model() -> tuple[ShipModel, np.ndarray]:
    start = InitialState(
        0.0, np.array([0.9, 0.1, 0.0]), np.array([3.0, 4.0, 0.0]), np.array([0.0, 0.0, 1.1]), np.eye(9) * 0.01
    )
    m = ShipModel()
    P = m.begin(start, Instruments(SHEETS))
    m.x[4] = 0.02  # turning
    m.x[7:] = 0.01
    return m, P


def perturbed(model: ShipModel, e: np.ndarray) -> ShipModel:
    other = deepcopy(model)
    other.position[:] = earth.displace(model.position, np.array([e[0], e[1], 0.0]))
    other.x[2:] += e[2:]
    return other


def difference(a: ShipModel, b: ShipModel) -> np.ndarray:
    return np.concatenate([earth.relative_position(a.position, b.position)[:2], (a.x - b.x)[2:]])


@pytest.mark.parametrize("sheet", SHEETS, ids=lambda s: s.name)
def test_jacobians_by_finite_differences(model, sheet: Datasheet):
    m, _ = model
    value = np.ones(len(sheet.sigma))
    if sheet.kind in ("gnss_position", "terrain_fix"):
        value = np.array([0.9, 0.1, 0.0])[: len(sheet.sigma)]
    measurement = Measurement(0.0, sheet.name, sheet.kind, value)
    jacobian = m.measure(measurement).jacobian
    for k in range(m.size):
        h = 1.0 if k < 2 else 1e-5
        e = np.zeros(m.size)
        e[k] = h
        fall = perturbed(m, -e).measure(measurement).innovation - perturbed(m, e).measure(measurement).innovation
        np.testing.assert_allclose(jacobian[:, k], fall / (2 * h), atol=2e-5 * max(1.0, np.abs(jacobian).max()))


def test_transition_by_finite_differences(model):
    """The covariance of a small error in each state, propagated, against the error itself."""
    m, _ = model

    def after(e: np.ndarray, covariance: np.ndarray) -> ShipModel:
        moved = perturbed(m, e)
        moved.propagate(covariance, 0.8)
        return moved

    noise = np.zeros((m.size, m.size))
    base = after(np.zeros(m.size), noise)
    for k in range(m.size):
        h = 1.0 if k < 2 else 1e-4
        e = np.zeros(m.size)
        e[k] = h
        there, back = (after(s * e, np.zeros((m.size, m.size))) for s in (1.0, -1.0))
        error = 0.5 * (difference(there, base) - difference(back, base)) / h
        P = np.outer(e, e)
        after(np.zeros(m.size), P)
        np.testing.assert_allclose((P - noise) / h**2, np.outer(error, error), atol=1e-4)


def stochastic_voyage(seed: int, duration: int, model: ShipModel, sheets: tuple[Datasheet, ...]) -> Recording:
    """A ship that moves by the model's own stochastic equations, sampled ten times a second."""
    rng = np.random.default_rng([seed, 5])
    dt, n = 0.1, 10 * duration
    u, psi = 6.0, 1.0
    r = model.turn_rate * rng.standard_normal()
    current = model.current * rng.standard_normal(2)
    shrink = np.exp(-dt / model.turn_time)
    kick = model.turn_rate * np.sqrt(1 - shrink**2)
    drift = np.exp(-dt / model.current_time)
    push = model.current * np.sqrt(1 - drift**2)
    position = np.array([0.7, 0.2, 0.0])
    meridian, prime = (float(x) for x in earth.principal_radii(0.7))
    states = np.empty((n + 1, 7))
    for k in range(n + 1):
        states[k] = (*position, u * np.cos(psi) + current[0], u * np.sin(psi) + current[1], u, psi)
        middle = psi + 0.5 * dt * r
        position[0] += dt * (u * np.cos(middle) + current[0]) / meridian
        position[1] += dt * (u * np.sin(middle) + current[1]) / (prime * np.cos(position[0]))
        psi += dt * r
        u += model.acceleration * np.sqrt(dt) * rng.standard_normal()
        r = shrink * r + kick * rng.standard_normal()
        current = drift * current + push * rng.standard_normal(2)
    time = dt * np.arange(n + 1)
    # Sideways motion belongs to the true velocity; it is white here, and too fast to move the ship.
    sideways = model.sway * rng.standard_normal(n + 1)
    velocity = np.zeros((n + 1, 3))
    velocity[:, 0] = states[:, 3] - np.sin(states[:, 6]) * sideways
    velocity[:, 1] = states[:, 4] + np.cos(states[:, 6]) * sideways
    streams = {}
    for sheet in sheets:
        at = np.arange(10, n + 1, 10)
        error = sheet.sigma * rng.standard_normal((len(at), len(sheet.sigma)))
        error = error + sheet.bias * rng.standard_normal(len(sheet.sigma))
        if sheet.kind == "gnss_position":
            value = earth.displace(states[at, :3], error)
        elif sheet.kind == "speed_log":
            value = (1.0 + sheet.scale * rng.standard_normal()) * states[at, 5:6] + error
        else:
            value = rotation.wrap_angle(states[at, 6:7] + error)
        zeros = np.zeros((len(at), len(sheet.sigma)))
        streams[sheet.name] = AidStream(
            sheet.name,
            sheet.kind,
            time[at],
            value,
            np.zeros(len(at), np.uint32),
            zeros,
            zeros + sheet.sigma,
            np.empty(0),
        )
    sigmas = np.array([5.0, 5.0, 5.0, 0.3, 0.3, 0.3, 0.01, 0.01, 1.0 * DEG])
    e = sigmas * rng.standard_normal(9)
    yaw = rotation.wrap_angle(states[:, 6])
    attitude = np.stack([np.zeros(n + 1), np.zeros(n + 1), yaw], axis=1)
    start = InitialState(
        0.0, earth.displace(states[0, :3], e[:3]), velocity[0] + e[3:6], attitude[0] + [0.0, 0.0, e[8]],
        np.diag(sigmas**2),
    )  # fmt: skip
    truth = NavigationStates(time, states[:, :3], velocity, attitude)
    block = Block(0.0, float(duration), None, None, streams, truth[10::10])
    return Recording("stochastic-v1", seed, Instruments(sheets), truth[:1], start, (), block)


def test_it_finds_the_biases_and_carries_through_an_outage(run_over):
    """Two minutes without GNSS at 6 m/s, 720 m: log bias, compass bias and current are known by then."""
    sheets = (SHEETS[3], SHEETS[4], Datasheet("gnss", "gnss_position", 1.0, np.array([3.0, 3.0, 6.0])))
    end, along = [], []
    for seed in range(8):
        estimator = ShipEkf()
        recording = stochastic_voyage(seed, 500, estimator.model, sheets)
        gnss = recording.data.aids["gnss"]
        keep = gnss.time <= 380.0
        for name in ("time", "value", "faults", "fault_error", "sigma"):
            object.__setattr__(gnss, name, getattr(gnss, name)[keep])
        errors, covariances = run_over(estimator, recording)
        end.append(np.hypot(*errors[-1, :2]))
        along.append(np.sqrt(covariances[-1, 0, 0] + covariances[-1, 1, 1]))
    assert np.sqrt(np.mean(np.square(end))) < 1.8 * np.mean(along)
    assert np.sqrt(np.mean(np.square(end))) < 40.0


@pytest.mark.parametrize(
    ("kinds", "needs"),
    [(("gnss",), "needs a compass"), (("compass",), "needs GNSS, a terrain fix, a speed log or a DVL")],
)
def test_what_it_needs(kinds: tuple[str, ...], needs: str):
    start = InitialState(0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.eye(9))
    with pytest.raises(UnsuitableScenario, match=needs):
        ShipEkf().reset(start, Instruments([s for s in SHEETS if s.name in kinds]))


def test_a_step_of_rounding_is_a_step():
    """Times that differ in their last bits are not divided by."""
    recording = record(load("ship-straight").model_copy(update={"duration": 5.0}), 1)
    for model in (ShipModel(), ShipPoints()):
        P = model.begin(recording.start, recording.instruments)
        model.propagate(P, 1e-12)
        assert model.time == 1e-12
        assert np.isfinite(P).all()
    states = model.x + np.zeros((2, model.size))
    model.move(states, 1e-12)
    assert np.isfinite(states).all()
