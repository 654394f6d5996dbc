"""Spoofing and jamming of raw observations of satellites."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.scoring import errors
from simnav.source import open_source, record
from simnav.spec import SpecError
from simnav.trial import run_trial
from simnav.types import KINDS
from tests.cases.raw_gnss import raw_gnss

SPOOFING = {"kind": "spoofing", "instruments": "gnss", "start_s": 10.0, "drift_m_s": [1.0, -0.5, 0.2],
            "offset_m": [2.0, 0.0, 0.0], "clock_drift_m_s": 0.3}  # fmt: skip
JAMMING = {"kind": "jamming", "instruments": "gnss", "start_s": 10.0, "end_s": 40.0, "loss": 24.0, "rise_s": 20.0}


def recorded(*faults: dict, **more) -> Recording:
    scenario = Scenario.from_toml({**raw_gnss(60.0).to_toml(), **more, "fault": list(faults)})
    return record(scenario, 2)


def test_a_spoofer_gives_the_ranges_of_the_false_position():
    """A least-squares solution of the errors of one time is the displacement and the clock, without a residual."""
    stream = recorded(SPOOFING).data.aids["gnss"]
    names = KINDS[stream.kind].side_names
    for time in (12.0, 30.0, 60.0):
        rows = np.abs(stream.time - time) < 0.1
        e, a = stream.side[rows, names.index("elevation")], stream.side[rows, names.index("azimuth")]
        u = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), -np.sin(e), -np.ones(len(e))], axis=1)
        assert rows.sum() >= 6
        for column, wanted in (
            (0, [2.0 + (time - 10.0), -0.5 * (time - 10.0), 0.2 * (time - 10.0), 0.3 * (time - 10.0)]),
            (1, [1.0, -0.5, 0.2, 0.3]),
        ):
            solution, residual, *_ = np.linalg.lstsq(-u, stream.fault_error[rows, column], rcond=None)
            np.testing.assert_allclose(solution, wanted, rtol=1e-9, atol=1e-9)
            assert np.all(residual < 1e-18)
    before = stream.time < 9.9
    assert not stream.faults[before].any()
    assert stream.faults[~before].all()


def test_only_other_instruments_contradict_it():
    drift = {**SPOOFING, "offset_m": [0.0, 0.0, 0.0], "drift_m_s": [1.0, -0.5, 0.0]}
    recording = recorded(drift)
    trial = run_trial(make("ekf"), recording)
    off = errors(trial, recording)[-1, :2]
    np.testing.assert_allclose(off, [50.0, -25.0], atol=6.0)
    receiver = {"kind": "gnss_receiver", "observations": "gnss", "sigma_m": [0.5, 0.5, 1.0]}
    instruments = {**raw_gnss(60.0).to_toml()["instruments"], "fix": receiver}
    fixes = recorded(drift, instruments=instruments).data.aids["fix"]
    clean = recorded(instruments=instruments).data.aids["fix"]
    moved = KINDS["gnss_position"].difference(fixes.value[-1:], clean.value[-1:])[0, :2]
    np.testing.assert_allclose(moved, [50.0, -25.0], atol=0.5)


def test_a_jammer_makes_noise_and_takes_the_weakest_first():
    calm, jammed = recorded().data.aids["gnss"], recorded(JAMMING).data.aids["gnss"]
    names = KINDS[jammed.kind].side_names
    ratio = names.index("density_ratio")
    within = (jammed.time > 9.9) & (jammed.time < 39.9)
    np.testing.assert_array_equal(jammed.value[~within][:8], calm.value[:8])
    assert jammed.side[:, ratio].min() >= 28.0
    assert len(jammed) + len(jammed.dropped) == len(calm) + len(calm.dropped)
    lost = {}
    for c, name in enumerate(jammed.channels):
        gone = jammed.dropped[jammed.dropped_channel == c]
        lost[name] = gone.min() if len(gone) else np.inf
    strength = {n: calm.side[(calm.channel == c) & (calm.time > 9.9), ratio][0] for c, n in enumerate(calm.channels)}
    order = sorted(lost, key=lambda n: strength[n])
    assert [lost[n] for n in order] == sorted(lost.values())
    # 12 dB are four times the noise, half way up.
    rows = np.abs(jammed.time - 20.0) < 0.1
    assert rows.any()
    for row in np.flatnonzero(rows):
        same = (calm.channel == jammed.channel[row]) & (np.abs(calm.time - jammed.time[row]) < 0.1)
        np.testing.assert_allclose(jammed.sigma[row] / calm.sigma[same][0], 10.0**0.6, rtol=1e-9)
    trial = run_trial(make("ekf"), recorded(JAMMING))
    assert trial.status == "ok"


def test_pieces_of_a_run_give_the_same():
    scenario = Scenario.from_toml({**raw_gnss(60.0).to_toml(), "fault": [SPOOFING, JAMMING]})
    whole, source = record(scenario, 2).data.aids["gnss"], open_source(scenario, 2)
    parts = [source.advance(end).aids["gnss"] for end in (7.0, 10.5, 33.0, 60.0)]
    for column in ("time", "value", "faults", "fault_error", "sigma", "side", "channel"):
        np.testing.assert_array_equal(np.concatenate([getattr(p, column) for p in parts]), getattr(whole, column))


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({**SPOOFING, "instruments": "fix"}, r"'spoofing' on 'fix' \(gnss_position\): it acts on pseudoranges"),
        ({**JAMMING, "instruments": "fix"}, r"'jamming' on 'fix' \(gnss_position\): .*a ramp or a noise_step does"),
        ({"kind": "spoofing", "instruments": "gnss"}, "offset_m, drift_m_s and the figures of the clock are all zero"),
        ({"kind": "jamming", "instruments": "gnss"}, "required key 'fault\\[0\\].loss' is missing|loss"),
        ({**JAMMING, "loss": -3.0}, "loss"),
    ],
)
def test_bad_faults(fault: dict, message: str):
    table = raw_gnss(60.0).to_toml()
    table["instruments"]["fix"] = {"kind": "gnss_position", "sigma_m": 1.0}
    with pytest.raises(SpecError, match=message):
        Scenario.from_toml({**table, "fault": [fault]})
