"""Instruments with channels in every solver: each channel has its own test, weight, flag, noise and biases.

The cases are two files of `tests/simnav/plugins`: ranges to moving beacons with the clock of a receiver, and a DVL of
four beams with one scale. Consistency on many runs and the agreement of filter, window, smoother and bound are in
`tests/estimators/test_state_blocks.py`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simnav import kinds
from simnav.estimator import UnsuitableScenario, make
from simnav.estimators.learning.filters import layout_of
from simnav.estimators.models.channels import ChannelDatasheet, by_channel, of_channels, owners, summary
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.estimators.solvers.admission import Admission
from simnav.estimators.solvers.filterpy_adapter import FilterpyEstimator
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.sigma_point import SigmaPointEstimator
from simnav.estimators.solvers.smoother import Smoother
from simnav.estimators.solvers.window import WindowEstimator
from simnav.kinds import Kind
from simnav.plugins import PluginError, import_file
from simnav.recording import Recording
from simnav.scenario import parse
from simnav.scoring import errors, nees_band
from simnav.source import record
from simnav.trial import Trial, run_trial
from simnav.types import KINDS, Instruments, Measurement, Measurements
from tests.cases.derivatives import innovation
from tests.cases.fjord import WITH_CHANNELS, fjord
from tests.estimators.test_state_blocks import SHIP, STEPS

#: A gross error on one channel of each case, in a seventh of its readings: far off.
GROSS = {"beacons": ("B", "size_m = [20.0, 60.0]"), "janus": ("1", "size_m_s = [1.0, 3.0]")}
#: A slow error of one channel.
SPOOFED = {"beacons": ("B", "slope_m_s = 0.5"), "janus": ("1", "slope_m_s2 = 0.03")}


@pytest.fixture(params=WITH_CHANNELS)
def case(request) -> str:
    return request.param


def with_fault(plugins: Path, case: str, kind: str, channel: str, rest: str, *, duration: float = 60.0, seed: int = 1):
    """The recording of a case with a fault on one channel."""
    fault = f'[[fault]]\nkind = "{kind}"\ninstruments = "{WITH_CHANNELS[case]}"\nchannels = ["{channel}"]\n{rest}\n'
    return record(fjord(plugins, case, duration=duration, tables=fault), seed)


def horizontal(trial: Trial, recording: Recording) -> float:
    return float(np.sqrt(np.mean(errors(trial, recording)[5:, :2] ** 2)))


# --- taken apart


def test_each_channel_has_the_datasheet_of_the_instrument_and_one_name(plugins):
    recording = record(fjord(plugins, "beacons", duration=4.0), 1)
    given, apart = recording.instruments, by_channel(recording.instruments)
    assert list(apart) == ["depth", *(f"beacons:{c}" for c in "ABCDE")]
    assert by_channel(apart) is apart
    assert apart["depth"] is given["depth"]
    assert apart.imu is given.imu
    one, sheet = apart["beacons:C"], given["beacons"]
    assert isinstance(one, ChannelDatasheet)
    assert (one.instrument, one.channel, one.siblings, one.channels) == ("beacons", "C", sheet.channels, ())
    assert np.array_equal(one.sigma, sheet.sigma)
    assert one.blocks == sheet.blocks


def test_the_channels_of_a_recording_are_all_its_readings(plugins, case):
    stream = record(fjord(plugins, case, duration=20.0), 1).data.aids[WITH_CHANNELS[case]]
    parts = of_channels(stream)
    assert [p.name for p in parts] == [f"{stream.name}:{c}" for c in stream.channels]
    assert sum(len(p) for p in parts) == len(stream)
    assert sum(len(p.dropped) for p in parts) == len(stream.dropped)
    for part, c in zip(parts, range(len(parts))):
        assert np.array_equal(part.value, stream.value[stream.channel == c])


def test_a_reading_is_taken_once_by_channel(plugins):
    instruments = by_channel(record(fjord(plugins, "beacons", duration=4.0), 1).instruments)
    admission = Admission(instruments, instruments)
    side = np.zeros(4)
    a, b, strange = (Measurement(1.0, "beacons", "moving_beacons", np.ones(1), c, side) for c in ("A", "B", "Z"))
    admitted = admission.admit(Measurements(0.0, 1.0, None, [a, b, a, strange]), 0.0)
    assert [m.source for m in admitted] == ["beacons:A", "beacons:B"]
    assert all(m.side is side for m in admitted)
    assert admission.skipped == 1
    late = a._replace(time=0.5)
    assert [m.source for m in admission.admit(Measurements(1.0, 2.0, None, [late, b._replace(time=1.5)]), 1.0)] == [
        "beacons:B"
    ]
    assert admission.skipped == 2


def test_the_instrument_is_the_mean_of_its_channels():
    owner = {"dvl:1": "dvl", "dvl:2": "dvl", "dvl:3": "dvl"}
    found = summary({"nis.dvl:1": 1.0, "nis.dvl:2": 3.0, "nis.dvl:3": np.nan, "nis.gnss": 9.0, "skipped": 0.0}, owner)
    assert found == {"nis.dvl": 2.0}
    assert np.isnan(summary({"nis.dvl:1": np.nan}, owner)["nis.dvl"])


# --- models


def begun(model: InertialModel, recording: Recording, name: str) -> list[Measurement]:
    """Begin a model, and bring it to the readings of an instrument at 3 s; its blocks are not zero."""
    start = replace(recording.start, attitude=np.array([0.3, -0.2, 2.5]))
    covariance = model.begin(start, by_channel(recording.instruments))
    for packet in recording.steps():
        model.load(packet.imu)
        model.propagate(covariance, packet.time)
        if packet.time >= 3.0:
            break
    model.calibration += 0.3 * np.sqrt(np.diag(covariance)[15:])
    aids = [m._replace(instrument=m.source, channel="") for m in packet if m.instrument == name and m.time == 3.0]
    assert len(aids) > 2
    return aids


def test_each_channel_has_its_jacobian_in_filter_and_points(plugins, case):
    model, name = InertialPoints(), WITH_CHANNELS[case]
    recording = record(fjord(plugins, case, duration=4.0), 2)
    rows = []
    for m in begun(model, recording, name):
        sigmas = np.concatenate([np.atleast_1d(b.sigma) for b in recording.instruments[name].blocks])
        numeric = np.empty((1, model.size))
        for k, h in enumerate([*STEPS, *(0.01 * sigmas)]):
            e = np.zeros(model.size)
            e[k] = h
            numeric[:, k] = (innovation(model, m, -e) - innovation(model, m, e)) / (2.0 * h)
        jacobian = model.measure(m).jacobian
        scale = np.abs(jacobian).max()
        np.testing.assert_allclose(jacobian, numeric, atol=3e-4 * scale, rtol=1e-3)  # the Earth is curved
        points = np.diag([*(10.0 * STEPS), *(0.01 * sigmas)])
        expected = np.array([innovation(model, m, np.zeros(model.size)) - innovation(model, m, e) for e in points])
        np.testing.assert_allclose(model.observe_points(m, points), expected, atol=1e-3 * np.abs(expected).max())
        rows.append(jacobian[0, :9] / scale)
    assert np.ptp(rows, axis=0).max() > 0.5  # they look in different directions


def test_the_noise_of_a_reading_follows_from_its_side_information(plugins):
    model = InertialModel()
    recording = record(fjord(plugins, "beacons", duration=4.0), 2)
    variance = {m.instrument: model.measure(m).noise[0, 0] for m in begun(model, recording, "beacons")}
    assert variance["beacons:A"] == pytest.approx(0.25)
    assert variance["beacons:B"] == pytest.approx(0.25 + 0.09)
    assert variance["beacons:C"] == pytest.approx(0.25 + 1.0)
    without = InertialModel(calibrate=False)
    m = begun(without, recording, "beacons")[2]
    clock = recording.instruments["beacons"].blocks[0].covariance(3.0)[0, 0]
    assert without.measure(m).noise[0, 0] == pytest.approx(1.25 + clock)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda side, sheet: np.ones(2), r"reading_sigma of kind 'moving_beacons'.*'beacons:A'.*shape \(1,\).*\[1.0"),
        (lambda side, sheet: np.array([-1.0]), "not negative"),
        (lambda side, sheet: side[9:10] / side[9], "raised IndexError"),
    ],
)
def test_a_wrong_sigma_of_a_reading_is_named(plugins, monkeypatch, wrong, message):
    model = InertialModel()
    m = begun(model, record(fjord(plugins, "beacons", duration=4.0), 2), "beacons")[0]
    object.__setattr__(model.own[m.instrument].kind, "reading_sigma", wrong)
    try:
        with pytest.raises(ValueError, match=message):
            model.measure(m)
    finally:
        fjord(plugins, "beacons")
        object.__setattr__(model.own[m.instrument].kind, "reading_sigma", import_sigma(plugins))


def import_sigma(plugins: Path):
    return import_file(plugins / "moving_beacons.py").sigma


def test_a_compiled_equation_has_no_sigma_of_a_reading():
    """Its noise is in the compiled loops."""
    depth = KINDS["depth"]
    with pytest.raises(PluginError, match="reading_sigma has an equation of its own"):
        Kind("depth", "depth", depth.components, kinds.DEPTH, reading_sigma=lambda side, sheet: sheet.sigma)


def twin(recording: Recording, channels: bool) -> Recording:
    """A recording whose fixes come twice: from two channels of one receiver, or from two receivers."""
    given, stream = recording.instruments, recording.data.aids["fix"]
    sheet = replace(given["fix"], bias=np.full(3, 0.5))
    moved = stream.value + np.array([1e-7, -1e-7, 0.3])
    names = ("fix:a", "fix:b")
    aids = {n: s for n, s in recording.data.aids.items() if n != "fix"}
    if channels:
        rows = np.repeat(np.arange(len(stream)), 2)
        both = np.stack([stream.value, moved], axis=1).reshape(-1, 3)
        aids["fix"] = replace(
            stream, time=stream.time[rows], value=both, faults=stream.faults[rows], sigma=stream.sigma[rows],
            fault_error=stream.fault_error[rows], channels=("a", "b"), side=np.empty((2 * len(stream), 0)),
            channel=np.tile(np.array([0, 1], np.int16), len(stream)),
        )  # fmt: skip
        sheets = [replace(sheet, channels=("a", "b"))]
    else:
        for name, value in zip(names, (stream.value, moved)):
            aids[name] = replace(stream, name=name, value=value)
        sheets = [replace(sheet, name=name) for name in names]
    others = [s for n, s in given.items() if n != "fix"]
    instruments = Instruments([*others, *sheets], given.imu, given.step)
    return replace(recording, instruments=instruments, data=replace(recording.data, aids=aids))


ROWS = ["ekf", "iekf", "inekf", "kf", "gnc-fgo", "iae", "iae-fgo", "vb-akf", "student-t", "gated-ekf", "heading-bank",
        "solution-separation", "ekf-9", "oracle"]  # fmt: skip


@pytest.mark.parametrize("row", ROWS)
def test_two_channels_of_a_compiled_kind_are_two_instruments(plugins, row):
    """To the last bit, estimate and flags."""
    text = '[[fault]]\nkind = "gross_error"\ninstruments = "fix"\nprobability = 0.2\nsize_m = [30.0, 90.0]\n'
    recording = record(fjord(plugins, "janus", duration=25.0, tables=text), 3)
    fixes = [s for n, s in recording.instruments.items() if n != "beams"]
    kept = {n: s for n, s in recording.data.aids.items() if n != "beams"}
    given = recording.instruments
    recording = replace(
        recording, instruments=Instruments(fixes, given.imu, given.step), data=replace(recording.data, aids=kept)
    )
    if row == "oracle":
        label = recording.faults[0]
        one, two = (
            twin(recording, True),
            replace(twin(recording, False), faults=(replace(label, instruments=("fix:a", "fix:b")),)),
        )
    else:
        one, two = twin(recording, True), twin(recording, False)
    a, b = run_trial(make(row), one), run_trial(make(row), two)
    assert (a.status, b.status) == ("ok", "ok"), (a.reason, b.reason)
    assert np.array_equal(a.position, b.position)
    assert np.array_equal(a.covariance, b.covariance)
    assert a.flagged == b.flagged
    for label, value in b.diagnostics.items():
        np.testing.assert_array_equal(a.diagnostics[label], value, err_msg=label)


# --- tests, weights and flags by channel


@pytest.mark.parametrize("row", ["ekf", "sw-fgo", "vb-akf", "imm", "solution-separation", "gtsam-isam2"])
def test_diagnostics_have_fixed_names_and_one_of_the_instrument(plugins, case, row):
    recording = record(fjord(plugins, case, duration=6.0), 1)
    estimator = make(row)
    estimator.reset(recording.start, recording.instruments)
    names = [frozenset(estimator.update(packet).diagnostics) for packet in recording.steps()]
    assert len(set(names)) == 1
    if row == "gtsam-isam2":  # it knows compiled equations only
        return
    first = "residual" if row == "sw-fgo" else "separation" if row == "solution-separation" else "nis"
    name = WITH_CHANNELS[case]
    channels = recording.instruments[name].channels
    assert {f"{first}.{name}", *(f"{first}.{name}:{c}" for c in channels)} <= names[0]
    assert owners(recording.instruments) == {f"{name}:{c}": name for c in channels}


@pytest.mark.parametrize("row", ["gated-ekf", "gnc-fgo"])
def test_a_gross_error_of_one_channel_is_rejected_on_it_alone(plugins, case, row):
    """It costs under a tenth of the accuracy, and the plain row loses more than half."""
    channel, size = GROSS[case]
    source = f"{WITH_CHANNELS[case]}:{channel}"
    found = []
    for seed in (1, 2, 3):
        clean = record(fjord(plugins, case), seed)
        faulty = with_fault(plugins, case, "gross_error", channel, f"probability = 0.15\n{size}", seed=seed)
        trials = [run_trial(make(name), r) for name, r in ((row, clean), (row, faulty), ("ekf", faulty))]
        assert {t.status for t in trials} <= {"ok", "inconsistent"}, [t.reason for t in trials]
        found.append([horizontal(t, r) for t, r in zip(trials, (clean, faulty, faulty))])
        labels = of_channels(faulty.data.aids[WITH_CHANNELS[case]])
        wrong = next(part for part in labels if part.name == source)
        flags = [(n, round(t, 3)) for n, t in trials[1].flagged]
        theirs = {t for n, t in flags if n == source}
        true = {round(t, 3) for t, f in zip(wrong.time.tolist(), wrong.faults.tolist()) if f}
        assert len(true) > 1
        assert len(theirs & true) > 0.95 * len(true)
        assert len([1 for n, _ in flags if n != source]) < 0.02 * sum(len(p) for p in labels)
    clean, faulty, plain = np.sqrt(np.mean(np.square(found), axis=0))
    assert faulty < 1.1 * clean
    assert plain > 1.5 * clean


def test_noise_is_estimated_by_channel(plugins, case):
    channel = GROSS[case][0]
    size = {"beacons": "sigma_m = 8.0", "janus": "sigma_m_s = 0.4"}[case]
    recording = with_fault(plugins, case, "noise_step", channel, size)
    name = WITH_CHANNELS[case]
    for row in ("iae", "vb-akf", "sage-husa", "iae-fgo", "imm"):
        trial = run_trial(make(row), recording)
        sigma = {k: np.nanmean(v[20:]) for k, v in trial.diagnostics.items() if k.startswith("sigma_") and ":" in k}
        component = next(iter(sigma)).split(".")[0]
        wrong = sigma.pop(f"{component}.{name}:{channel}")
        # A window of ten innovations sees a twentieth at most: bounds, and tests of the datasheet.
        assert wrong > 2.0 * max(sigma.values()), (row, wrong, sigma)


def test_a_spoofed_channel_is_excluded_by_itself(plugins, case):
    """After the first minute, in which a wrong start is looked for and nothing is excluded."""
    channel, size = SPOOFED[case]
    recording = with_fault(plugins, case, "ramp", channel, f"start_s = 65.0\n{size}", duration=120.0)
    trial, plain = (run_trial(make(row), recording) for row in ("solution-separation", "ekf"))
    name = WITH_CHANNELS[case]
    out = {c: trial.diagnostics[f"excluded.{name}:{c}"] for c in recording.instruments[name].channels}
    assert out.pop(channel)[-20:].all()
    assert not any(each.any() for each in out.values())
    assert horizontal(trial, recording) < 0.7 * horizontal(plain, recording)
    assert trial.diagnostics[f"excluded.{name}"][-1] == pytest.approx(1.0 / (len(out) + 1))
    level = trial.diagnostics["protection_level"]
    assert np.all(np.hypot(*errors(trial, recording)[:, :2].T) < level)


def test_the_oracle_knows_the_fault_of_a_channel(plugins, case):
    channel, size = SPOOFED[case]
    recording = with_fault(plugins, case, "ramp", channel, f"start_s = 20.0\n{size}", duration=90.0)
    oracle, smoothed, clean = (
        run_trial(make(row), recording) for row in ("oracle", "oracle-rts", "oracle-clairvoyant")
    )
    assert {oracle.status, smoothed.status, clean.status} == {"ok"}
    plain = horizontal(run_trial(make("ekf"), recording), recording)
    assert horizontal(clean, recording) <= horizontal(oracle, recording) * 1.2 < 0.6 * plain
    e, P = errors(oracle, recording)[-1, :3], oracle.covariance[-1, :3, :3]
    assert e @ np.linalg.solve(P, e) < 16.3
    outages = with_fault(plugins, case, "frozen", channel, "start_s = 20.0")
    told = run_trial(make("oracle"), outages)
    assert all(n == f"{WITH_CHANNELS[case]}:{channel}" for n, _ in told.flagged)
    assert len(told.flagged) > 30


# --- other models


@pytest.mark.parametrize("row", ["ship-ekf", "ship-ukf", "ship-fgo"])
def test_a_ship_s_model_takes_beams(plugins, row):
    """It loses nothing by beams that say the speed over the ground, and is right about itself."""
    beams = '[instruments.fix]\nkind = "gnss_position"\nsigma_m = 2.0\n'
    beams += '[instruments.beams]\nkind = "janus"\nsigma_m_s = 0.05\nsound_speed = 0.02\n'
    scenario = parse(SHIP.format(file="janus.py") + beams, folder=plugins)
    nees, known = [], []
    for seed in range(6):
        trial = run_trial(make(row), recording := record(scenario, seed))
        assert trial.status == "ok", trial.reason
        assert trial.diagnostics["nis.beams:2" if row != "ship-fgo" else "weight.beams:2"][-1] >= 0.0
        e, P = errors(trial, recording)[-1, :2], trial.covariance[-1, :2, :2]
        nees.append(e @ np.linalg.solve(P, e) / 2.0)
        known.append(trial.diagnostics["sigma.beams.sound_speed"][-1, 0])
    low, high = nees_band(2, 6, 0.999)
    assert low < np.mean(nees) < high
    assert max(known) < 0.02


def test_a_model_of_a_third_party_takes_them(plugins):
    model = import_file(plugins / "steady_turn.py").SteadyTurn
    table = '[instruments.fix]\nkind = "gnss_position"\nsigma_m = 2.0\n'
    table += '[instruments.beams]\nkind = "janus"\nsigma_m_s = 0.5\nsound_speed = 0.02\n'
    scenario = parse(SHIP.format(file="janus.py") + table, folder=plugins)
    recording = record(scenario.model_copy(update={"duration": 30.0}), 1)
    solvers = {
        "ekf": KalmanEstimator(model()),
        "ukf": SigmaPointEstimator(model()),
        "rts": KalmanEstimator(model(), smoother=Smoother()),
        "window": WindowEstimator(model()),
    }
    found = {}
    for name, solver in solvers.items():
        trial = run_trial(solver, recording)
        assert trial.status == "ok", trial.reason
        found[name] = horizontal(trial, recording)
    assert found["window"] == pytest.approx(found["ekf"], rel=0.02)
    assert found["ukf"] == pytest.approx(found["ekf"], rel=0.02)


# --- who cannot take them says so


def test_a_filter_of_filterpy_says_that_it_gets_no_side_information(plugins):
    class Beams(FilterpyEstimator):
        name, uses = "of-filterpy", ("janus",)
        needs = ()

        def build(self, start, instruments):
            raise AssertionError

        predict = correct = None

    Beams.__abstractmethods__ = frozenset()
    recording = record(fjord(plugins, "janus", duration=4.0), 1)
    with pytest.raises(UnsuitableScenario, match=r"of-filterpy cannot use the channels of 'beams'.*side information"):
        Beams().reset(recording.start, recording.instruments)


def test_a_learning_task_says_that_it_takes_no_channels(plugins):
    recording = record(fjord(plugins, "janus", duration=4.0), 1)
    with pytest.raises(UnsuitableScenario, match="'beams' has the channels 1, 2, 3, 4"):
        layout_of([recording.instruments], "all")
