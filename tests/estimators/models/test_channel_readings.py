"""All readings of the channels of an instrument at one time are what they are one by one."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from simnav.blocks import StateBlock
from simnav.estimator import make
from simnav.estimators.algebra.joseph import joseph_sequence
from simnav.estimators.models import inertial
from simnav.estimators.models.base import ErrorModel
from simnav.estimators.models.channels import by_channel, owners
from simnav.estimators.models.columns import Columns
from simnav.estimators.models.delayed import DELAY
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.measurement_functions import MeasurementFunction
from simnav.estimators.models.measurements import State
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.ship_observation import PlacedShip
from simnav.estimators.solvers.admission import Admission, together
from simnav.geometry.earth import relative_position
from simnav.kinds import Component, Kind
from simnav.plugins import PluginError
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Measurement
from tests.cases.raw_gnss import raw_gnss

BEAMS = """
name = "beams"
version = 1
title = "Beams of a DVL"
duration_s = 5.0
water_depth_m = 30.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
speed_m_s = 2.0
[instruments.imu]
rate_hz = 20.0
[instruments.beams]
kind = "dvl_beams"
rate_hz = 1.0
mounting_deg = 0.1
lever_arm_m = [1.0, 0.2, 0.5]
"""


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(raw_gnss(30.0), 1)


def wandering(model: InertialModel, count: int) -> tuple[list[State], State]:
    """States of a model that is corrected at random, one by one, and the same as columns."""
    rng, states = np.random.default_rng(1), []
    for _ in range(count):
        model.correct(rng.standard_normal(model.size) * 0.01)
        states.append(State(*(a.copy() for a in model._state())))
    return states, State(*(np.stack(column) for column in zip(*states, strict=True)))


def test_innovations_and_jacobians(recording: Recording):
    model = InertialModel()
    model.begin(recording.start, by_channel(recording.instruments))
    (many,) = model.many
    stream = recording.data.aids["gnss"]
    rows = np.arange(0, len(stream), 7)
    names = [f"gnss:{stream.channels[c]}" for c in stream.channel[rows]]
    states, columns = wandering(model, len(rows))
    innovation, jacobian = many.linearise(
        stream.time[rows],
        stream.value[rows],
        many.channels(names),
        columns,
        np.arange(len(rows)),
        stream.side[rows],
    )
    for k, (row, name) in enumerate(zip(rows, names, strict=True)):
        one = model.observe_own(name, float(stream.time[row]), stream.value[row], states[k], stream.side[row])
        assert one is not None
        np.testing.assert_allclose(innovation[k], one[0], rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(jacobian[k], one[1], rtol=1e-9, atol=1e-9)
    assert many.channels(["gnss:none", "compass"]).tolist() == [-1, -1]


def test_channels_with_biases():
    """Each beam of a DVL has a bias of its own, beside the blocks that all beams share."""
    scenario = Scenario.from_toml(tomllib.loads(BEAMS), source="beams")
    recording = record(scenario, 3)
    model = InertialModel()
    model.begin(recording.start, by_channel(recording.instruments))
    (many,) = model.many
    assert many.biased
    assert len(model.bias_at) == 4
    stream = recording.data.aids["beams"]
    rows = np.arange(len(stream))
    names = [f"beams:{stream.channels[c]}" for c in stream.channel]
    states, columns = wandering(model, len(rows))
    innovation, jacobian = many.linearise(stream.time, stream.value, many.channels(names), columns, rows, stream.side)
    for k, name in enumerate(names):
        one = model.observe_own(name, float(stream.time[k]), stream.value[k], states[k], stream.side[k])
        assert one is not None
        assert one[1][0, model.bias_at[name]] == 1.0
        np.testing.assert_allclose(innovation[k], one[0], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(jacobian[k], one[1], rtol=0.0, atol=1e-12)


def test_beams_of_a_ship():
    """The same at the states of a ship, which have no velocity, attitude and angular rate of their own."""
    given = (
        BEAMS
        + "bias_m_s = 0.05\n[instruments.gnss_position]\nsigma_m = 2.0\n[instruments.gyrocompass]\nsigma_deg = 0.5\n"
    )
    recording = record(Scenario.from_toml(tomllib.loads(given), source="beams"), 3)
    model = ShipModel()
    model.begin(recording.start, by_channel(recording.instruments))
    (many,) = model.many
    assert many.biased
    stream, rng, states = recording.data.aids["beams"], np.random.default_rng(2), []
    names = [f"beams:{stream.channels[c]}" for c in stream.channel]
    for _ in names:
        model.correct(rng.standard_normal(model.size) * 0.1)
        states.append(PlacedShip(model.position.copy(), model.x.copy()))
    columns = PlacedShip(*(np.stack(column) for column in zip(*states, strict=True)))
    rows = np.arange(len(stream))
    innovation, jacobian = many.linearise(stream.time, stream.value, many.channels(names), columns, rows, stream.side)
    for k, name in enumerate(names):
        one = model.observe_own(name, float(stream.time[k]), stream.value[k], states[k], stream.side[k])
        assert one is not None
        np.testing.assert_allclose(innovation[k], one[0], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(jacobian[k], one[1], rtol=0.0, atol=1e-12)


def test_an_unknown_delay_has_no_such_form():
    """The function for many readings knows no delay: the state that tells it would have no effect."""
    given = BEAMS + "timing = { offset_s = 0.05 }"
    sheet = by_channel(Scenario.from_toml(tomllib.loads(given), source="beams").instruments_sheet())["beams:2"]
    late = replace(sheet, blocks=(*sheet.blocks, StateBlock(DELAY, 1, "s", 0.05)))
    assert MeasurementFunction(sheet).observations is not None
    assert MeasurementFunction(late).observations is None


@pytest.mark.parametrize("name", ["sw-fgo", "gnc-fgo"])
def test_a_window_gives_the_same(recording: Recording, monkeypatch: pytest.MonkeyPatch, name: str):
    at_once = run_trial(make(name), recording)
    monkeypatch.setattr(inertial, "channel_readings_of", lambda own, bias_at: [])
    one_by_one = run_trial(make(name), recording)
    assert (at_once.status, one_by_one.status) == ("ok", "ok")
    np.testing.assert_allclose(at_once.position, one_by_one.position, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(at_once.covariance, one_by_one.covariance, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("name", ["sw-fgo", "gnc-fgo"])
def test_a_window_takes_them_together_as_one_by_one(recording: Recording, monkeypatch: pytest.MonkeyPatch, name: str):
    """To the bit: their noise and their factors."""
    at_once = run_trial(make(name, window=5), recording)
    monkeypatch.setattr(InertialModel, "nominal_noises", ErrorModel.nominal_noises)
    one_by_one = run_trial(make(name, window=5), recording)
    assert (at_once.status, one_by_one.status) == ("ok", "ok")
    np.testing.assert_array_equal(at_once.position, one_by_one.position)
    np.testing.assert_array_equal(at_once.covariance, one_by_one.covariance)
    for label in ("residual.gnss", "residual.gnss:G11", "weight.gnss:E27", "cost"):
        np.testing.assert_array_equal(at_once.diagnostics[label], one_by_one.diagnostics[label])


def test_the_noise_of_many_is_that_of_each(recording: Recording):
    model = InertialModel()
    instruments = by_channel(recording.instruments)
    model.begin(recording.start, instruments)
    (group,) = together(
        Admission(instruments, instruments).admit(next(recording.steps()), 0.0), owners(recording.instruments)
    )
    noise = model.nominal_noises(group)
    assert noise is not None
    assert noise.shape == (8, 2, 2)
    np.testing.assert_array_equal(noise, [model.nominal_noise(m) for m in group])
    assert len(np.unique(noise[:, 0, 0])) > 4
    # A sigma that is not a number is left to the reading that it belongs to.
    wrong = [m._replace(side=np.full_like(m.side, np.nan)) if k == 3 else m for k, m in enumerate(group)]
    assert model.nominal_noises(wrong) is None
    with pytest.raises(ValueError, match=r"reading_sigma of kind 'gnss_raw'.*finite and not negative"):
        model.nominal_noise(wrong[3])


def test_readings_of_one_instrument_at_one_time_are_a_group():
    owner = {"gnss:G1": "gnss", "gnss:G2": "gnss", "dvl:1": "dvl"}
    read = [(1.0, "gnss:G1"), (1.0, "gnss:G2"), (1.0, "dvl:1"), (1.0, "depth"), (2.0, "gnss:G1"), (3.0, "gnss:G2")]
    groups = together([Measurement(time, name, "depth", np.zeros(1)) for time, name in read], owner)
    assert [[m.instrument for m in group] for group in groups] == [
        ["gnss:G1", "gnss:G2"], ["dvl:1"], ["depth"], ["gnss:G1"], ["gnss:G2"]
    ]  # fmt: skip


def test_rows_that_are_appended_together():
    one, many = Columns(value=(2,), number=np.int64), Columns(value=(2,), number=np.int64)
    for k in range(200):
        one.append(value=(k, -k), number=7)
    many.append(value=(0.0, 0.0), number=7)
    values = np.arange(1.0, 200.0)
    many.append_rows(199, value=np.stack([values, -values], axis=1), number=7)
    for name in ("value", "number"):
        np.testing.assert_array_equal(many[name], one[name])
    many.drop(150)
    many.append_rows(100, value=0.0, number=1)
    assert len(many) == 150
    assert many["value"][:2].tolist() == [[150.0, -150.0], [151.0, -151.0]]
    assert many["number"].tolist() == [7] * 50 + [1] * 100


def test_a_compiled_equation_has_no_such_form():
    with pytest.raises(PluginError, match="a kind with observations has an equation of its own: a function"):
        Kind("depth", "depth", (Component("depth", "m"),), "depth", observations=lambda points, sheet: None)


def test_a_filter_takes_them_together_as_one_by_one(recording: Recording, monkeypatch: pytest.MonkeyPatch):
    """To what the second derivatives of the ranges are worth: the state moves by metres, the satellites are far."""
    at_once = run_trial(make("ekf"), recording)
    monkeypatch.setattr(inertial, "channel_readings_of", lambda own, bias_at: [])
    one_by_one = run_trial(make("ekf"), recording)
    np.testing.assert_allclose(relative_position(at_once.position, one_by_one.position), 0.0, atol=1e-3)
    variances = (np.diagonal(trial.covariance, axis1=1, axis2=2) for trial in (at_once, one_by_one))
    np.testing.assert_allclose(*variances, rtol=1e-3)
    nis = "nis.gnss:G11"
    np.testing.assert_allclose(at_once.diagnostics[nis], one_by_one.diagnostics[nis], rtol=2e-2, atol=1e-3)


def test_a_sequence_of_updates_is_one_large_one():
    rng = np.random.default_rng(3)
    root = rng.standard_normal((7, 7))
    first = root @ root.T
    H, R, y = rng.standard_normal((4, 2, 7)), np.stack([np.diag([0.5, 2.0])] * 4), rng.standard_normal((4, 2))
    P, dx, nis, size = first.copy(), np.empty(7), np.empty(4), np.empty(4)
    joseph_sequence(P, y, H, R, dx, nis, size)
    tall = H.reshape(8, 7)
    S = tall @ first @ tall.T + np.diag([0.5, 2.0] * 4)
    gain = first @ tall.T @ np.linalg.inv(S)
    np.testing.assert_allclose(dx, gain @ y.ravel(), rtol=1e-9)
    np.testing.assert_allclose(P, first - gain @ S @ gain.T, atol=1e-9)
    assert nis.sum() == pytest.approx(y.ravel() @ np.linalg.solve(S, y.ravel()))
    assert size[0] == pytest.approx(np.hypot(*y[0]))
