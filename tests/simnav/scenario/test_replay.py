"""The errors of a recording on a simulated voyage."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from simnav.scenario import load, parse
from simnav.scenario.residuals import residuals
from simnav.simulation.simulator import Simulator, ideal, simulate
from simnav.spec import SpecError

DATA = Path(os.environ.get("SIMNAV_DATA", "data"))
needs_nbp1406 = pytest.mark.skipif(not (DATA / "nbp1406").is_dir(), reason=f"no folder nbp1406 in {DATA} (SIMNAV_DATA)")
HEAD = """
name = "replayed"
version = 1
title = "Real errors, exact truth"
duration_s = 1200.0
[start]
latitude_deg = 54.0
longitude_deg = 8.0
speed_m_s = 5.0
[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.0
[[instruments.gyrocompass.error]]
kind = "replay"
log = "ship-nbp1406"
instrument = "gyrocompass"
"""


def errors(scenario, seed: int) -> np.ndarray:
    real, exact = simulate(scenario, seed), ideal(scenario, seed)
    return real.data.aids["gyrocompass"].value[:, 0] - exact.data.aids["gyrocompass"].value[:, 0]


@needs_nbp1406
@pytest.mark.filterwarnings("ignore::simnav.log.LogWarning")
def test_the_errors_are_those_of_the_recording_in_blocks():
    scenario = parse(HEAD)
    error = errors(scenario, 1)
    (recorded,) = residuals(load("ship-nbp1406"), "gyrocompass")
    real = recorded.error[:, 0] - recorded.error[:, 0].mean()
    assert error.std() == pytest.approx(real.std(), rel=0.15)
    # Every error is one of the recording, and within a block they follow one another as there.
    nearest = np.abs(error[:, None] - real[None]).argmin(axis=1)
    np.testing.assert_allclose(real[nearest], error, atol=1e-9)
    follows = np.diff(nearest) == 1
    assert follows.mean() > 0.9
    assert not np.array_equal(error, errors(scenario, 2))


@needs_nbp1406
@pytest.mark.filterwarnings("ignore::simnav.log.LogWarning")
def test_blocks_of_any_length_and_the_datasheet():
    scenario = parse(HEAD)
    simulator = Simulator(scenario, 3)
    parts = [simulator.advance(t).aids["gyrocompass"].value for t in (17.0, 300.0, 1200.0)]
    np.testing.assert_array_equal(np.concatenate(parts), simulate(scenario, 3).data.aids["gyrocompass"].value)
    (process,) = scenario.instruments_sheet()["gyrocompass"].processes
    assert np.degrees(process.block.sigma[0]) == pytest.approx(0.146, abs=0.01)
    assert 1.0 < process.block.correlation_time < 5.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("ship-nbp1406", "ship-nbp1407"), "ship-nbp1407"),
        (("ship-nbp1406", "open-sea"), "no instrument 'gyrocompass'|does not measure"),
        (('instrument = "gyrocompass"', 'instrument = "gnss"'), "is of kind 'gnss_position'; it should be of the kind"),
        (("ship-nbp1406", "./own.toml"), "should be the name of a recorded scenario of a catalogue, not a path"),
        (("ship-nbp1406", "auv-akit"), "does not measure 'gyrocompass'"),
    ],
)
def test_what_cannot_be_replayed_is_refused(change, message):
    with pytest.raises(SpecError, match=message):
        parse(HEAD.replace(*change))
