"""A ship without an IMU and an instrument of a third party, whose kind brings its own observation."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import find, make, names
from simnav.estimators.models.ship_chain import ShipChain
from simnav.estimators.models.ship_points import ShipPoints
from simnav.scenario import parse
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Measurement
from tests.cases.derivatives import innovation

#: A ship that loses its GNSS receiver after 60 s and turns; a radar measures range and bearing to a beacon ashore.
COAST = """
name = "coast"
version = 1
title = "A ship and a beacon ashore"
plugins = ["beacon.py"]
duration_s = 300.0

[start]
latitude_deg = 54.0
longitude_deg = 7.9
heading_deg = 40.0
speed_m_s = 5.0

[vessel]
kind = "ship"
turn_rate_deg_s = 1.0

[[manoeuvre]]
kind = "hold"
duration_s = 100.0

[[manoeuvre]]
kind = "turn"
angle_deg = 120.0

[current]
speed_m_s = 0.5
direction_deg = 200.0

[instruments.gnss]
kind = "gnss_position"
sigma_m = 3.0

[instruments.gyrocompass]
sigma_deg = 0.5
bias_deg = 0.5

[instruments.speed_log]
sigma_m_s = 0.1
bias_m_s = 0.1

[instruments.radar]
kind = "beacon"
rate_hz = 0.5
latitude_deg = 54.015
longitude_deg = 7.92
height_m = 20.0
sigma_range_m = 3.0
sigma_bearing_deg = 0.5
bias_range_m = 2.0
bias_bearing_deg = 0.3
lever_arm_m = [10.0, 1.0, -12.0]

[[fault]]
kind = "outage"
instruments = "gnss"
start_s = 60.0
"""


@pytest.fixture
def recording(plugins):
    return record(parse(COAST, folder=plugins), 3)


def begun(model, recording):
    """A model that has started on a recording; a measurement of the radar."""
    covariance = model.begin(recording.start, recording.instruments)
    model.propagate(covariance, 1.0)
    model.x[4:] = np.linspace(0.01, 0.02, len(model.x) - 4)
    return Measurement(1.0, "radar", "beacon", recording.data.aids["radar"].value[0])


def test_the_jacobian_is_that_of_finite_differences(recording):
    model = ShipPoints()
    m = begun(model, recording)
    jacobian, h = model.measure(m).jacobian, 1e-4
    numeric = [(innovation(model, m, -h * e) - innovation(model, m, h * e)) / (2.0 * h) for e in np.eye(model.size)]
    # The file leaves out that metres per radian change over the distance to the beacon: 2 km of the Earth's radius.
    np.testing.assert_allclose(jacobian, np.transpose(numeric), atol=1e-3, rtol=1e-3)
    at = model.bias_at["radar"]
    assert np.array_equal(jacobian[:, at : at + 2], np.eye(2))


def test_points_are_the_model_s_own_prediction_at_each(recording):
    model = ShipPoints()
    m = begun(model, recording)
    scale = np.concatenate([[100.0, 100.0, 0.5, 0.2, 1e-3, 0.1, 0.1], np.full(model.size - 7, 0.05)])
    errors = scale * np.random.default_rng(3).standard_normal((20, model.size))
    expected = [innovation(model, m, np.zeros(model.size)) - innovation(model, m, e) for e in errors]
    assert model.observe_points(m, errors) == pytest.approx(np.array(expected), abs=1e-4)
    linear = errors @ model.measure(m).jacobian.T
    assert np.abs(linear - expected).max() > 0.05  # they are far enough for the difference to matter


def test_what_the_model_takes_for_zero_is_noise(recording):
    model = ShipPoints()
    linearised = model.measure(begun(model, recording))
    nominal = np.diag(recording.instruments["radar"].sigma ** 2)
    assert np.linalg.eigvalsh(linearised.noise - nominal).min() >= -1e-12
    assert np.trace(linearised.noise - nominal) > 0.0


def test_a_chain_linearises_it_beside_its_own(recording):
    chain = ShipChain(ShipPoints())
    chain.begin(recording.start, recording.instruments)
    for packet, _ in zip(recording.steps(), range(5)):
        chain.propagate(packet.time)
        chain.extend()
        for m in packet.aids:
            chain.attach([m], chain.nominal_noise(m)[None])
    chain.linearise_motion()
    chain.linearise_aids()
    aids = chain.aids
    assert {chain.names[i] for i in aids["instrument"]} == {"gnss", "gyrocompass", "speed_log", "radar"}
    for i in np.flatnonzero(aids["node"] == aids["node"][-1]):  # those of the newest node, where the front still is
        name, d = chain.names[aids["instrument"][i]], aids["components"][i]
        kind = recording.instruments[name].kind
        value = aids["value"][i].copy() if kind == "gnss_position" else aids["value"][i, :d].copy()
        linearised = chain.front.measure(Measurement(chain.time, name, kind, value))
        assert aids["residual"][i, :d] == pytest.approx(linearised.innovation, abs=1e-9)
        assert aids["jacobian"][i, :d] == pytest.approx(linearised.jacobian, abs=1e-12)
        assert not aids["residual"][i, d:].any()
        assert not aids["jacobian"][i, d:].any()


def test_filters_points_and_graphs_navigate_by_it_when_there_are_no_fixes(plugins):
    aided = [record(parse(COAST, folder=plugins), seed) for seed in range(4)]
    rare = COAST.replace("rate_hz = 0.5", "rate_hz = 0.001")
    blind = [record(parse(rare, folder=plugins), seed) for seed in range(4)]

    def mean(name: str, figure: str, recordings) -> float:
        return float(np.mean([score(run_trial(make(name), r), r)[figure] for r in recordings]))

    for name in ("ship-ekf", "ship-ukf", "ship-fgo"):
        assert mean(name, "horizontal_rmse", aided) < 0.6 * mean(name, "horizontal_rmse", blind)
        assert 0.4 < mean(name, "nees_horizontal", aided) < 1.6


def test_every_row_meets_the_kind_and_runs_or_says_what_it_needs(plugins):
    scenario = parse(COAST.partition("[[fault]]")[0], folder=plugins)
    recording = record(scenario.model_copy(update={"duration": 8.0}), 1)
    trials = [run_trial(make(name), recording) for name in names() if not find(name).slow]
    assert not {t.estimator: t.reason for t in trials if t.failed}
    assert sum(t.status == "ok" for t in trials) > 20
