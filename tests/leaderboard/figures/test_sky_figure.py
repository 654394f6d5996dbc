"""The sky and the place of a run with satellites: what is shown is what was received."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.labels import REFLECTION
from simnav.leaderboard.figures.run_figure import run_figure
from simnav.leaderboard.figures.sky_view import State, sky_view
from simnav.leaderboard.site.sky_charts import sky_charts, sky_data
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial


@pytest.fixture(scope="module")
def harbour():
    scenario = load("satellites-harbour").model_copy(update={"duration": 60.0})
    return scenario, record(scenario, 3)


def test_states_are_those_of_the_labels(harbour):
    scenario, recording = harbour
    view, stream = sky_view(recording, scenario), recording.data.aids["gnss"]
    bit = next(j for j, fault in enumerate(recording.faults) if fault.kind == REFLECTION)
    found = {(float(view.time[i]), view.satellites[j]): int(view.state[i, j]) for i, j in np.ndindex(view.state.shape)}
    assert len(view.time) == 60
    given = {}
    for time, c, faults in zip(stream.time, stream.channel, stream.faults, strict=True):
        reflected = bool(faults >> np.uint32(bit) & 1)
        given[float(time), stream.channels[c]] = State.REFLECTED if reflected else State.RECEIVED
    assert State.REFLECTED in given.values()
    assert {k: v for k, v in found.items() if v != State.MISSING} == given
    assert view.error.max() == np.abs(stream.fault_error[:, 0]).max() > 1.0


def test_directions_with_and_without_the_scenario_agree(harbour):
    """Without it they are those of the readings; the satellites that were not heard are missing."""
    scenario, recording = harbour
    whole, heard = sky_view(recording, scenario), sky_view(recording)
    assert set(heard.satellites) <= set(whole.satellites)
    assert not heard.outlines
    own = [whole.satellites.index(name) for name in heard.satellites]
    for seen, told in ((whole.elevation, heard.elevation), (whole.azimuth, heard.azimuth)):
        apart = np.angle(np.exp(1j * (seen[:, own] - told)))
        assert np.nanmax(np.abs(apart)) < np.radians(0.01)


def test_obstacles_stand_where_the_run_has_them(harbour):
    """The map of the scenario has its origin where the vessel starts, but for what is drawn."""
    scenario, recording = harbour
    view = sky_view(recording, scenario)
    drawn = scenario.drawn(3).surroundings["obstacles"]
    start = recording.initial_truth.position[0]
    north = (drawn.latitude - start[0]) * 6.363e6
    for shown, given in zip(view.outlines, drawn.obstacle, strict=True):
        assert shown.top == given.top
        assert shown.north.mean() == pytest.approx(given.outline()[:, 0].mean() + north, abs=0.5)


def test_the_figure_of_a_run_has_the_sky(harbour):
    scenario, recording = harbour
    trial = run_trial(make("ekf"), recording)
    titles = [ax.get_title("left") for ax in run_figure(recording, [("ekf", trial)], (), scenario).axes]
    assert "Satellites of gnss" in titles
    assert any(title.startswith("Obstacles") for title in titles)
    nothing = replace(recording, data=replace(recording.data, aids={"fix": recording.data.aids["fix"]}))
    assert sky_view(nothing, scenario) is None


def test_the_charts_of_the_site_show_the_same(harbour):
    """A point at its distance from the zenith; each reflection; outlines that are closed."""
    scenario, recording = harbour
    view = sky_view(recording, scenario)
    data = sky_data(view)
    spots = data["sky"]["spots"]
    away = np.hypot(spots["x"], spots["y"])
    np.testing.assert_allclose(away, 90.0 - np.array(spots["elevation"]), atol=0.1)
    np.testing.assert_allclose(np.degrees(np.arctan2(spots["x"], spots["y"])) % 360.0, spots["azimuth"], atol=0.3)
    assert spots["state"].count("error by a reflection") == (view.state == State.REFLECTED).sum()
    walls = data["place"]["walls"]
    assert walls["part"].count(0) == 5
    assert [c.name for c in sky_charts(data, "3")] == ["sky", "place"]
    assert sky_charts(sky_data(None), "3") == []
