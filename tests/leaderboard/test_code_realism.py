"""Errors of pseudoranges of a receiver that stands still, beside simulated ones."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from simnav.geometry.ecef import ecef_from_geodetic
from simnav.leaderboard.realism.codes import compared, correlations, fitted, main, real_codes, simulated_codes
from simnav.leaderboard.results.recording_rinex import write_rinex
from simnav.log.table import LogError
from simnav.scenario import Scenario
from simnav.sensors.gnss_raw import SHIPPED
from simnav.simulation.simulator import simulate
from simnav.source import record

DATA = Path(os.environ.get("SIMNAV_DATA") or Path(__file__).parents[3] / "shared" / "data") / "rinex"
PAIR = DATA / "SEPT078M.21O", DATA / "SEPT078M.21P"
real_pair = pytest.mark.skipif(not PAIR[0].is_file(), reason=f"no {PAIR[0].name} in {DATA} (SIMNAV_DATA)")
PLACE = {"latitude_deg": 54.0, "longitude_deg": 7.9}


def station(speed: float = 0.0, **settings: object) -> Scenario:
    raw = {**PLACE, "span_s": 600.0, "sigma_range_rate_m_s": 0.03, **settings}
    return Scenario.from_toml({
        "name": "station", "version": 1, "title": "a station", "duration_s": 600.0,
        "start": {**PLACE, "speed_m_s": speed}, "vessel": {"kind": "ship"}, "instruments": {"gnss_raw": raw},
    })  # fmt: skip


@pytest.fixture(scope="module")
def real():
    return real_codes(*PAIR)


@real_pair
def test_the_simulated_errors_are_like_those_of_a_real_receiver(real):
    """Standard deviations by ten degrees within 25 %, correlations after 1, 10 and 60 s within 0.15."""
    simulated = simulated_codes(real, PAIR[1], fitted(real), range(12))
    bands = compared(real, simulated)
    assert sum(band.satellites for band in bands) == 20
    assert [band.lowest for band in bands] == [10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 80.0]
    for band in bands:
        assert band.simulated == pytest.approx(band.real, rel=0.25), band
    np.testing.assert_allclose(correlations(simulated), correlations([real]), atol=0.15)


@real_pair
def test_the_station_is_where_rtklib_finds_it(real):
    """Both solve the codes alone; RTKLIB has other weights."""
    rtklib = pytest.importorskip("tests.simnav.satellites.rtklib")
    theirs = np.median(list(rtklib.points(str(PAIR[0]), str(PAIR[1]), None, 30).values()), axis=0)
    assert np.linalg.norm(ecef_from_geodetic(real.position) - theirs) < 1.0


def test_figures_that_a_recording_was_made_with_are_found_again(tmp_path):
    """By way of the RINEX file, in which only the observations are left."""
    scenario = station(sigma_pseudorange_m=0.3, galileo_noise=0.6, noise_time_s=8.0, correlation_time_s=86400.0)
    write_rinex(simulate(scenario, 1), tmp_path / "station.rnx")
    found = fitted(real_codes(tmp_path / "station.rnx", SHIPPED))
    assert found["sigma_pseudorange_m"] == pytest.approx(0.3, rel=0.15)
    assert found["galileo_noise"] == pytest.approx(0.6, rel=0.2)
    assert found["noise_time_s"] == pytest.approx(8.0, rel=0.3)


def test_noise_that_is_correlated_has_the_standard_deviation_of_white_noise():
    """The same recording but for the noise: its variance, and its correlation exp(-t / T)."""
    white, coloured = (
        record(station(sigma_pseudorange_m=0.2, noise_time_s=time), 2).data.aids["gnss_raw"] for time in (0.0, 10.0)
    )
    none = record(station(sigma_pseudorange_m=0.0), 2).data.aids["gnss_raw"]
    assert np.array_equal(white.sigma, coloured.sigma)
    assert np.array_equal(white.value[:, 1], coloured.value[:, 1])
    noise = (coloured.value[:, 0] - none.value[:, 0]) / coloured.sigma[:, 0]
    by_satellite = [noise[coloured.channel == c] for c in np.unique(coloured.channel)]
    whole = [series for series in by_satellite if len(series) > 500]
    assert np.sqrt(np.mean(np.concatenate(whole) ** 2)) == pytest.approx(1.0, abs=0.1)
    after = np.mean([np.mean(series[10:] * series[:-10]) for series in whole])
    assert after == pytest.approx(np.exp(-1.0), abs=0.12)


def test_what_cannot_be_compared_is_said(tmp_path, capsys):
    write_rinex(simulate(station(speed=8.0, sigma_pseudorange_m=0.3), 1), tmp_path / "moving.rnx")
    with pytest.raises(LogError, match=r"moving\.rnx: the receiver moved"):
        real_codes(tmp_path / "moving.rnx", SHIPPED)
    if PAIR[1].is_file():
        with pytest.raises(LogError, match="give no position"):
            real_codes(tmp_path / "moving.rnx", PAIR[1])  # ephemerides of another year
    assert main([]) == 2
    assert "observation file" in capsys.readouterr().err
