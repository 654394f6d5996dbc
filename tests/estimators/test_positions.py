"""Rows that leave out every position of a run do not suit it; those that navigate without one by design do."""

from __future__ import annotations

import pytest

from simnav.estimator import lacking, make, names, unsuitable
from simnav.source import open_source, record
from simnav.trial import run_trial
from simnav.types import Instruments
from tests.cases.positioned_by_sound import positioned_by_sound
from tests.cases.raw_gnss import raw_gnss

GTSAM = {"gtsam-batch", "gtsam-fixed-lag", "gtsam-gnc", "gtsam-isam2"}
#: Rows over the model of a ship, which has no states for the clock of a receiver.
SHIP = {
    "anfis-ekf", "anfis-fgo", "anfis-fgo-motion", "filterpy-ukf", "ship-ckf", "ship-ekf", "ship-ekf-rts",
    "ship-ekf-standing", "ship-fgo", "ship-fgo-full", "ship-ukf",
}  # fmt: skip
_SHIP = """
[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.3
[instruments.speed_log]
rate_hz = 1.0
sigma_m_s = 0.1
"""
_RECEIVER = """
[instruments.receiver]
kind = "gnss_receiver"
observations = "gnss"
sigma_m = [1.0, 1.0, 2.0]
"""


def left_out(instruments: Instruments) -> set[str]:
    """The rows that have what they need, and use no position."""
    made = {name: make(name) for name in names()}
    ready = {name: row for name, row in made.items() if not lacking(row.needs, instruments)}
    assert {"dead-reckoning", "inertial", "ekf", "oracle"} <= ready.keys()
    return {name for name, row in ready.items() if unsuitable(row, instruments)}


@pytest.mark.parametrize("sound", ["usbl", "lbl", "one beacon"])
def test_rows_without_an_equation_for_sound_do_not_suit_where_sound_alone_positions(sound: str) -> None:
    assert left_out(open_source(positioned_by_sound(sound, 20.0), 0).instruments) == GTSAM


def test_rows_without_a_clock_do_not_suit_where_raw_satellites_alone_position() -> None:
    assert left_out(open_source(raw_gnss(20.0, _SHIP), 0).instruments) == GTSAM | SHIP
    assert left_out(open_source(raw_gnss(20.0, _SHIP + _RECEIVER), 0).instruments) == set()
    assert "it uses no instrument that gives a position; here that is gnss (gnss_raw)" in unsuitable(
        make("ship-ekf"), open_source(raw_gnss(20.0, _SHIP), 0).instruments
    )


def test_such_a_run_is_not_made() -> None:
    recording = record(positioned_by_sound("lbl", 5.0), 0)
    assert (run_trial(make("gtsam-fixed-lag"), recording).status, len(run_trial(make("ekf"), recording))) == (
        "unsuitable",
        len(recording.data.truth),
    )
