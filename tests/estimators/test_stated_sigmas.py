"""A reading that states its sigma is used with it, by every solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.recording import Recording
from simnav.scenario import parse
from simnav.source import record
from simnav.trial import run_trial
from simnav.trial.wire import PacketDecoder, PacketEncoder
from simnav.types import Instruments

TOML = """
name = "stated"
version = 1
title = "readings that state their sigma"
duration_s = 15.0

[initial_error]
position_m = [3.0, 3.0, 3.0]
velocity_m_s = [0.2, 0.2, 0.2]
attitude_deg = [0.5, 0.5, 2.0]

[start]
latitude_deg = 54.0
longitude_deg = 8.0
speed_m_s = 5.0

[instruments.gnss]
kind = "gnss_position"
sigma_m = 1.0

[instruments.gyrocompass]
sigma_deg = 0.5

[instruments.speed_log]
sigma_m_s = 0.1

[instruments.imu]
rate_hz = 10.0
grade = "mems"
"""


@pytest.fixture(scope="module")
def recording():
    return record(parse(TOML), 3)


def stating(recording, factor):
    """The same readings, of which all but every third state ``factor`` times the sigma of the datasheet."""
    gnss = recording.data.aids["gnss"]
    side = np.where(np.arange(len(gnss))[:, None] % 3 > 0, factor, 1.0) * recording.instruments["gnss"].sigma
    aids = {**recording.data.aids, "gnss": replace(gnss, side=side)}
    sheets = [replace(s, stated=True) if s.name == "gnss" else s for s in recording.instruments.values()]
    known = Instruments(sheets, recording.instruments.imu, recording.instruments.step)
    return replace(recording, instruments=known, data=replace(recording.data, aids=aids))


def with_two_receivers(recording, factor):
    """The same in another form: two receivers, each with a datasheet of its own."""
    gnss = recording.data.aids["gnss"]
    worse = np.arange(len(gnss)) % 3 > 0
    aids = {"gnss": replace(gnss.rows(~worse), name="gnss"), "other": replace(gnss.rows(worse), name="other")}
    aids |= {n: a for n, a in recording.data.aids.items() if n != "gnss"}
    sheet = recording.instruments["gnss"]
    sheets = [sheet, replace(sheet, name="other", sigma=factor * sheet.sigma)]
    sheets += [s for s in recording.instruments.values() if s.name != "gnss"]
    known = Instruments(sheets, recording.instruments.imu, recording.instruments.step)
    return replace(recording, instruments=known, data=replace(recording.data, aids=aids))


@pytest.mark.parametrize("row", ["ekf", "ekf-rts", "ukf", "sw-fgo", "student-t", "ship-ekf"])
def test_it_is_as_a_receiver_with_that_datasheet(recording, row):
    stated = run_trial(make(row), stating(recording, 4.0))
    apart = run_trial(make(row), with_two_receivers(recording, 4.0))
    plain = run_trial(make(row), recording)
    assert stated.status == apart.status == "ok"
    np.testing.assert_allclose(stated.position, apart.position, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(stated.covariance, apart.covariance, rtol=1e-5, atol=1e-12)
    assert np.max(np.abs(stated.position[:, :2] - plain.position[:, :2])) > 1e-8


def test_a_row_that_has_stated_sigmas_once_runs_without_them_again(recording):
    row = make("ekf")
    before = run_trial(row, recording)
    run_trial(row, stating(recording, 4.0))
    after = run_trial(row, recording)
    np.testing.assert_array_equal(before.position, after.position)


def test_they_are_kept_and_sent(recording, tmp_path):
    given = stating(recording, 2.0)
    given.save(tmp_path / "a.npz")
    loaded = Recording.load(tmp_path / "a.npz")
    np.testing.assert_array_equal(loaded.data.aids["gnss"].side, given.data.aids["gnss"].side)
    assert loaded.instruments["gnss"].stated
    assert not loaded.instruments["gyrocompass"].stated
    packets = PacketEncoder(given.data, given.data.truth.time)
    decode = PacketDecoder(packets.streams)
    for k, expected in enumerate(given.steps()):
        (received,) = decode(bytearray(b"".join(packets[k])))
        for mine, theirs in zip(received, expected, strict=True):
            np.testing.assert_array_equal(mine.side, theirs.side)
            np.testing.assert_array_equal(mine.value, theirs.value)
