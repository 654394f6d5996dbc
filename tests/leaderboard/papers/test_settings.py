"""The settings of the papers: values are those of the scenarios' files, and every paper says where they come from."""

from __future__ import annotations

import pytest

from simnav.leaderboard.papers import PAPERS, reading
from simnav.leaderboard.papers.measures import scores_of, value_of
from simnav.leaderboard.papers.report import settings_sheet
from simnav.leaderboard.papers.settings import SOURCES, PaperSetting, value_of_key
from simnav.leaderboard.results.result import Result


@pytest.mark.parametrize("key", PAPERS)
def test_every_setting_has_a_value_and_a_source(key):
    settings = reading.paper_of(key).settings
    assert len(settings) > 15
    assert {s.source for s in settings} <= set(SOURCES)
    assert {"printed", "ours"} <= {s.source for s in settings}
    for s in settings:
        assert s.value, s.what
        assert s.printed or s.source == "ours", s.what
    sheet = settings_sheet(reading.paper_of(key))
    assert [row.cells[3] for row in sheet.rows] == [s.source for s in settings]


def setting(source: str, **said: str) -> PaperSetting:
    return PaperSetting(what="x", source=source, scenario="coastal-voyage", **said)


def test_the_value_is_that_of_the_file():
    assert setting("printed", printed="1 Hz", key="instruments.gnss.rate_hz").value == "1"
    assert setting("ours", key="fault[1].sigma_m", ours="m").value == "4, 4, 6 m"
    assert setting("ours", ours="none").value == "none"
    with pytest.raises(KeyError):
        value_of_key("coastal-voyage", "instruments.gnss.rate")


def test_the_printed_imu_of_the_road_test_is_in_the_drive():
    imu = reading.paper_of("mao-2025").scenario("mao-drive").instruments["imu"]
    assert imu.gyroscope.random_walk == pytest.approx(0.17 * 3.14159265 / 180.0 / 60.0)
    assert imu.accelerometer.bias == pytest.approx(15e-6 * 9.80665)


def test_the_white_noise_of_the_auv_is_that_of_each_sample():
    """0.01 deg/h as the noise of a sample at 100 Hz: the random walk is that times the root of 0.01 s."""
    gyroscope = reading.paper_of("auv-smoothing-2022").scenario("auv-survey-white-imu").instruments["imu"].gyroscope
    assert gyroscope.random_walk / 0.01**0.5 == pytest.approx(0.01 * 3.14159265 / 180.0 / 3600.0)
    assert gyroscope.bias_instability == 0.0


def test_ratios_of_axes():
    result = Result("s", 0, "e", {}, False, "ok", "", {"north_rmse": 2.0, "east_rmse": 3.0, "vertical_rmse": 1.0})
    assert (value_of(result, "east_over_north"), value_of(result, "down_over_horizontal")) == (1.5, 0.5)
    assert scores_of("east_over_north") == ("north_rmse", "east_rmse")
