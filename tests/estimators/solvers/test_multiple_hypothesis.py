"""Several hypotheses: the right one is found for each fault, and none where nothing is wrong."""

from __future__ import annotations

import tomllib
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from simnav.estimator import make
from simnav.estimators.algebra.mixture import mixture_update
from simnav.estimators.models.doubted_instruments import BiasDoubt, DoubtedInstruments
from simnav.estimators.models.flat_lines import FlatLineTest
from simnav.estimators.solvers import multiple_hypothesis
from simnav.estimators.solvers.hypothesis_filter import lone_fix
from simnav.estimators.solvers.multiple_hypothesis import KINDS
from simnav.scenario import Scenario
from simnav.scoring import score
from simnav.scoring.navigation_error import errors
from simnav.source import record
from simnav.trial import run_trial
from tests.audit import recommended
from tests.cases.samples_as_given import as_given

SHORT = tomllib.loads((Path(__file__).parents[2] / "cases" / "short.toml").read_text(encoding="utf-8"))


def recorded(fault=None, seed=3, instruments=None, **tables):
    """A minute and a half of a ship with IMU, GNSS, DVL and compass; ``instruments`` changes some (None: none)."""
    table = deepcopy(SHORT)
    table |= {"duration_s": 90.0, "water_depth_m": 30.0, **tables}
    table["instruments"]["imu"] |= {
        "gyroscope": {"random_walk_deg_sqrt_h": 0.05, "bias_deg_h": 1.0},
        "accelerometer": {"random_walk_ug_sqrt_hz": 50.0, "bias_ug": 200.0},
    }
    table["instruments"]["gnss"] |= {"rate_hz": 1.0}
    table["instruments"]["dvl"] = {"rate_hz": 1.0, "sigma_m_s": 0.02}
    table["instruments"]["gyrocompass"] = {"rate_hz": 1.0, "sigma_deg": 0.3}
    for name, changes in (instruments or {}).items():
        if changes is None:
            table["instruments"].pop(name, None)
        else:
            table["instruments"][name] = table["instruments"].get(name, {}) | changes
    if fault is not None:
        table["fault"] = fault if isinstance(fault, list) else [fault]
    return record(Scenario.from_toml(table, source="short"), seed)


def ran(recording, row="mh-ekf"):
    trial = run_trial(make(row), recording)
    assert trial.status in ("ok", "inconsistent"), trial.reason
    return trial


def rms(trial, recording):
    return float(np.sqrt(np.mean(np.sum(np.square(errors(trial, recording)[:, :2]), axis=1))))


@pytest.fixture(scope="module")
def clean():
    recording = recorded()
    return recording, ran(recording)


def test_a_start_without_a_heading_is_a_bank_of_headings():
    """The heading is wrong, and honestly told to be unknown; a filter of one heading ends more than 90 deg off."""
    start = {"attitude_deg": [0.5, 0.5, 120.0], "position_m": [2.0, 2.0, 3.0], "velocity_m_s": [0.05, 0.05, 0.05]}
    recording = recorded(instruments={"gyrocompass": None}, seed=11, initial_error=start)
    trial = ran(recording)
    assert trial.diagnostics["hypotheses"][0] > 15.0
    assert trial.diagnostics["hypotheses"][-1] <= 6.0
    error = errors(trial, recording)[-1]
    assert abs(error[8]) < np.radians(2.0)
    assert np.hypot(*error[:2]) < 5.0
    plain = run_trial(make("ekf"), recording)
    assert abs(errors(plain, recording)[-1, 8]) > np.radians(90.0)


def test_it_is_the_plain_filter_where_nothing_is_wrong(clean):
    recording, trial = clean
    assert rms(trial, recording) < 1.03 * rms(ran(recording, "ekf"), recording)
    for name in ("gnss", "dvl", "gyrocompass", "imu"):
        assert trial.diagnostics[f"doubt.{name}"].max() < 0.1
        assert np.isnan(trial.diagnostics[f"since.{name}"]).all()
    assert trial.flagged == []


@pytest.mark.parametrize(
    ("name", "fault", "gain"),
    [
        ("gnss", {"kind": "ramp", "instruments": ["gnss"], "slope_m_s": [0.8, 0.0, 0.0]}, 0.4),
        ("gnss", {"kind": "bias_step", "instruments": ["gnss"], "offset_m": [40.0, 0.0, 0.0]}, 0.3),
        ("dvl", {"kind": "bias_step", "instruments": ["dvl"], "offset_m_s": [1.0, 0.0, 0.0]}, 0.5),
        ("gyrocompass", {"kind": "bias_step", "instruments": ["gyrocompass"], "offset_deg": 15.0}, 0.9),
        ("imu", {"kind": "imu_disturbance", "angular_rate_deg_s": 1.0}, 0.5),
    ],
)
def test_it_finds_what_is_wrong_and_since_when(name, fault, gain):
    recording = recorded({**fault, "start_s": 40.0, "end_s": 80.0})
    trial = ran(recording)
    doubt, time = trial.diagnostics[f"doubt.{name}"], trial.time
    assert doubt[time < 38.0].max() < 0.5
    assert doubt[(time > 42.0) & (time < 80.0)].max() > 0.9
    since = trial.diagnostics[f"since.{name}"]
    assert abs(np.nanmedian(since) - 40.0) < 15.0  # what surprises nobody begins at one of the regular times
    assert rms(trial, recording) < gain * rms(ran(recording, "ekf"), recording)
    if name != "imu":
        assert {source for source, _ in trial.flagged} >= {name}
        scores = score(trial, recording, ("detection_rate", "false_alarm_rate"))
        assert scores["detection_rate"] > 0.3
        assert scores["false_alarm_rate"] < 0.2


def test_a_start_that_is_worse_than_told_is_found_out():
    table = {"initial_error": {"position_m": [2.0, 2.0, 2.0], "times_told": {"position": 20.0}}}
    recording = recorded(seed=1, **table)
    assert rms(ran(recording), recording) < 0.7 * rms(ran(recording, "ekf"), recording)


def test_a_gross_error_needs_no_hypothesis_and_is_flagged():
    recording = recorded({
        "kind": "gross_error", "instruments": ["gnss"], "start_s": 30.0, "end_s": 80.0, "probability": 0.1,
        "size_m": [60.0, 90.0],
    })  # fmt: skip
    trial = ran(recording)
    assert {source for source, _ in trial.flagged} == {"gnss"}
    assert score(trial, recording, ("detection_rate",))["detection_rate"] > 0.9
    assert np.mean(trial.diagnostics["doubt.gnss"]) < 0.3


def test_a_copy_in_mid_run_goes_on_like_the_original():
    recording = recorded()
    one = make("mh-ekf")
    one.reset(recording.start, recording.instruments)
    packets = list(recording.steps())
    for packet in packets[:30]:
        one.update(packet)
    other = deepcopy(one)
    for packet in packets[30:60]:
        a, b = one.update(packet), other.update(packet)
        assert np.array_equal(a.position, b.position)
        assert np.array_equal(a.covariance, b.covariance)


def test_the_evidence_is_the_density_of_the_innovation_over_its_levels():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(4, 4))
    P, H, R = A @ A.T, rng.normal(size=(2, 4)), np.diag([0.5, 2.0])
    v, levels, before = np.array([1.0, -2.0]), np.array([1.0, 9.0]), np.array([0.7, 0.3])
    cross = P @ H.T
    S = H @ cross
    expected = sum(p * multivariate_normal(cov=S + x * R).pdf(v) for p, x in zip(before, levels))
    *_, evidence = mixture_update(P.copy(), cross, S, R, v, levels, np.eye(2), before.copy(), np.empty(4))
    assert evidence == pytest.approx(np.log(expected))


def test_a_group_that_is_believed_again_has_the_errors_of_its_datasheets():
    recording = recorded()
    model = DoubtedInstruments().choose(recording.instruments, "row")
    covariance = model.begin(recording.start, recording.instruments)
    before = covariance.copy(), [rates.copy() for rates in model.rates()], model.imu_noise.copy()
    for name in ("jumping fixes", "log", "compass", "imu"):
        KINDS[name].doubt.begin(model, covariance)
    decay, density = model.rates()
    at = model.places["fix"]
    assert decay[at.rates] == pytest.approx(np.full(3, 1.0 / 40.0))
    assert density[at.rates] == pytest.approx(np.full(3, 2.0 * 15.0**2 / 40.0))
    assert covariance[at.states, at.states] == pytest.approx(before[0][at.states, at.states] + 15.0**2)
    for group in ("fix", "log", "compass", "imu"):
        model.believe(covariance, group)
    assert np.array_equal(decay, before[1][0])
    assert np.array_equal(density, before[1][1])
    assert np.array_equal(model.imu_noise, before[2])
    # The biases of the IMU stay as uncertain as they were made.
    imu = np.zeros(len(covariance), bool)
    imu[9:15] = True
    assert np.array_equal(covariance[np.ix_(~imu, ~imu)], before[0][np.ix_(~imu, ~imu)])
    assert np.all(covariance.diagonal()[imu] > before[0].diagonal()[imu])


def test_a_doubted_bias_stays_stationary():
    """A process of 4 m and 100 s, from nothing: after 1000 s its sigma is 4 m."""
    recording = recorded()
    model = DoubtedInstruments().choose(recording.instruments, "row")
    covariance = model.begin(recording.start, recording.instruments)
    BiasDoubt("fix", sigma=4.0, time=100.0).begin(model, covariance)
    packets = list(recording.steps())
    at, time = model.places["fix"].states, 0.0
    for packet in packets[:50]:
        model.load(packet.imu)
        model.propagate(covariance, packet.time)
        time = packet.time
    expected = 16.0 * (1.0 - np.exp(-2.0 * time / 100.0))
    assert covariance[at, at] == pytest.approx(np.full(3, expected), rel=1e-3)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"period": 0.0}, "period = 0 s: it must be above 0 and finite"),
        ({"onset": -1.0}, "onset = -1 s: it must be above 0 and finite"),
        ({"filters": 2}, "filters = 2: it must be 3 or more"),
    ],
)
def test_parameters_out_of_range_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        make("mh-ekf", **parameters)


def test_the_audit_says_which_promises_are_kept():
    def scores(error, coverage):
        return {"error": [error, error], "coverage": [coverage, coverage], "time": [1e-3, 1e-3]}

    def scenario(own, coverage=0.95):
        others = {row: scores(1.0, 0.9) for row in ("ekf", "oracle", "iae-fgo", "vb-akf")}
        return {"mh-ekf": scores(own, coverage), **others}

    found = {"open-sea": scenario(1.02), "gnss-spoofing": scenario(2.0, coverage=0.5), "imu-clipping": scenario(1.5)}
    said = {what: (figure, kept) for what, figure, _, kept in recommended.rows(found)}
    assert said["mh-ekf: Aided INS, times oracle"] == ("1.45", True)
    assert said["mh-ekf: nothing wrong, times oracle"] == ("1.02", True)
    assert said["mh-ekf: gnss-spoofing, times the better of iae-fgo and vb-akf"] == ("2.00", False)
    assert said["mh-ekf: the IMU wrong, times ekf"] == ("1.50", False)
    assert said["mh-ekf: 95 % region, Fixes that lie slowly"] == ("50.0 %", False)
    assert said["mh-ekf: 95 % region, Nothing wrong"] == ("95.0 %", True)
    assert said["mh-ekf: 95 % region, simulated, nothing wrong"] == ("95.0 %", True)
    assert said["mh-ekf: time of an update, times ekf"] == ("1.0", True)


def test_saturated_gyroscopes_condemn_no_instrument(monkeypatch):
    sea = {"significant_height_m": 8.0, "peak_period_s": 11.0, "direction_deg": 70.0}
    fault = {"kind": "imu_clipping", "start_s": 40.0, "end_s": 90.0, "angular_rate_limit_deg_s": 0.8}
    recording = recorded(fault, seed=4, sea=sea)

    def doubted(trial):
        return max(trial.diagnostics[f"doubt.{name}"].max() for name in ("gnss", "dvl", "gyrocompass"))

    trial = ran(recording)
    assert doubted(trial) < 0.1
    monkeypatch.setattr(FlatLineTest, "samples", staticmethod(as_given))
    blind = ran(recording)
    assert doubted(blind) > 0.9
    assert rms(trial, recording) < 0.5 * rms(blind, recording)


def test_a_rare_fix_with_the_imu_alone_beside_it_is_believed_like_the_imu():
    fault = {"kind": "imu_disturbance", "angular_rate_deg_s": 0.3, "start_s": 40.0, "end_s": 60.0}
    alone = recorded(fault, instruments={"gnss": {"rate_hz": 0.1}, "dvl": None, "gyrocompass": None})
    trial = ran(alone)
    assert trial.diagnostics["doubt.gnss"].max() == trial.diagnostics["doubt.imu"].max() == 0.0
    assert rms(trial, alone) < 1.02 * rms(ran(alone, "ekf"), alone)


def test_a_dvl_that_is_left_alone_does_not_turn_the_heading(monkeypatch):
    cut = {"kind": "outage", "instruments": ["gnss"], "start_s": 40.0}
    shaken = {"kind": "imu_disturbance", "angular_rate_deg_s": [4.0, -4.0, 0.0], "start_s": 51.0, "end_s": 52.0}
    recording = recorded([cut, shaken], seed=4, instruments={"gyrocompass": None}, duration_s=120.0)

    def heading_error(trial):
        return abs(errors(trial, recording)[-1, 8])

    assert heading_error(ran(recording)) < np.radians(1.0)
    monkeypatch.setattr(multiple_hypothesis, "SILENT_INTERVALS", np.inf)  # as if the fixes still saw the heading
    assert heading_error(ran(recording)) > np.radians(5.0)


@pytest.mark.parametrize(
    ("rate", "beside", "expected"),
    [(0.1, {}, "gnss"), (1.0, {}, ""), (0.1, {"dvl": {"rate_hz": 1.0, "sigma_m_s": 0.02}}, "")],
)
def test_a_fix_is_lone_where_it_is_rare_and_no_log_is_beside_it(rate, beside, expected):
    instruments = recorded(instruments={"gnss": {"rate_hz": rate}, "dvl": None, **beside}).instruments
    assert lone_fix(instruments) == expected
