"""A terrain-matching computer: its fixes, what makes them wrong, and when there are none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from simnav.recording import AidStream
from simnav.scenario import Scenario
from simnav.sensors.terrain_match import TerrainMatch
from simnav.simulation.simulator import Simulator, ideal, simulate
from simnav.spec import SpecError
from simnav.types import KINDS, Array
from simnav.world.bathymetry import Bathymetry
from simnav.world.depth_grid import DepthGrid
from tests.cases.over_terrain import matched

#: Reliefs on which no threshold was chosen.
ROUGH: dict[str, Any] = {"seed": 71}
FLAT: dict[str, Any] = {"seed": 72, "roughness_m": 0.2, "slope_percent": 0.4}
PROFILE: dict[str, Any] = {"kind": "multibeam_profile", "beams": 7, "swath_deg": 60.0, "rate_hz": 0.5}


def fixes(scenario: Scenario, seed: int = 1) -> tuple[AidStream, Array]:
    """The fixes of a run, and their errors north and east [m]."""
    recording = simulate(scenario, seed)
    stream, truth = recording.data.aids["match"], recording.data.truth
    place = truth.position[np.searchsorted(truth.time, stream.time - 1e-6), :2]
    return stream, KINDS["terrain_match"].difference(stream.value, place)


@pytest.mark.parametrize("sounder", [{}, PROFILE], ids=["altimeter", "profile"])
def test_over_a_rough_bottom_fixes_are_right_and_as_sure_as_they_say(sounder: Any) -> None:
    squares: list[float] = []
    for seed in (1, 2):
        stream, error = fixes(matched(400.0, sounder=sounder, bottom=ROUGH), seed)
        assert len(stream) >= 7
        assert np.linalg.norm(error, axis=1).max() < 4.0
        squares += np.sum((error / stream.sigma) ** 2, axis=1).tolist()
    low, high = chi2.ppf([0.001, 0.999], 2 * len(squares))
    assert low < sum(squares) < high


def test_over_a_flat_bottom_there_are_no_fixes_or_their_sigma_covers_the_error() -> None:
    stream, error = fixes(matched(400.0, bottom=FLAT))
    assert len(stream.dropped) >= 7
    assert (abs(error) < 4.0 * stream.sigma).all()


def repeated() -> DepthGrid:
    """A bottom that repeats itself every 200 m eastwards."""
    rng = np.random.default_rng(5)
    north, east = 10.0 * np.arange(-150, 151)[:, None], 10.0 * np.arange(-150, 151)[None]
    depth = np.full((301, 301), 90.0)
    for times in (1, 1, 2, 2, 3, 4, 5):
        phase = rng.uniform(-0.06, 0.06) * north + 2.0 * np.pi * times * east / 200.0 + rng.uniform(0.0, 2.0 * np.pi)
        depth += 3.0 / times * np.cos(phase)
    return DepthGrid(np.array([np.radians(54.0), np.radians(7.9), 0.0]), np.full(2, 10.0), depth)


def test_false_matches_come_from_a_terrain_that_repeats_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = repeated()
    monkeypatch.setattr(Bathymetry, "grid", lambda self: grid)
    unasked = [fixes(matched(50.0, match={"uniqueness": 1.0}), seed) for seed in range(1, 6)]
    assert all(len(stream) == 1 for stream, _ in unasked)
    errors = np.concatenate([error for _, error in unasked])
    sigma = np.concatenate([stream.sigma for stream, _ in unasked])
    false = abs(errors[:, 1]) > 100.0
    assert false.any()  # which of two equal places it is, rounding decides
    np.testing.assert_allclose(abs(errors[false, 1]), 200.0, atol=4.0)
    np.testing.assert_allclose(errors[~false], 0.0, atol=4.0)
    assert sigma.max() < 3.0
    assert not any(stream.faults.any() for stream, _ in unasked)  # the device does not know it
    assert not any(len(fixes(matched(50.0), seed)[0]) for seed in range(1, 6))


def test_a_level_bottom_gives_no_fixes() -> None:
    table = matched(120.0).to_toml()
    del table["surroundings"]
    stream, _ = fixes(Scenario.from_toml(table | {"water_depth_m": 90.0}))
    assert stream.dropped.tolist() == [50.0, 100.0]
    assert stream.side.shape == (0, 2)


def test_without_a_place_to_begin_the_whole_chart_is_searched() -> None:
    table = matched(100.0, bottom=ROUGH).to_toml()
    for key in ("latitude_deg", "longitude_deg"):
        del table["instruments"]["match"][key]
    stream, error = fixes(Scenario.from_toml(table))
    assert len(stream) >= 1
    assert np.linalg.norm(error, axis=1).max() < 4.0


def test_fixes_do_not_depend_on_blocks() -> None:
    fault = {"kind": "bias_step", "instruments": ["dvl"], "start_s": 60.0, "end_s": 80.0, "offset_m_s": [0.1, 0.0, 0.0]}
    scenario = matched(210.0, bottom=ROUGH, sounder={"false_readings": 0.05}, fault=[fault])
    whole = Simulator(scenario, 4).advance(210.0).aids["match"]
    simulator = Simulator(scenario, 4)
    ends = [7.0, 49.0, 50.0, 51.0, 99.0, 173.0, 174.0, 210.0]
    parts = AidStream.concatenate([simulator.advance(end).aids["match"] for end in ends])
    assert len(whole) >= 3
    for name in ("time", "value", "faults", "fault_error", "sigma", "side", "dropped"):
        assert getattr(whole, name).tobytes() == getattr(parts, name).tobytes(), name


def test_a_fault_of_the_velocity_is_a_fault_of_the_fix() -> None:
    fault = {
        "kind": "bias_step", "instruments": ["dvl"], "start_s": 110.0, "end_s": 140.0, "offset_m_s": [0.0, 0.03, 0.0],
    }  # fmt: skip
    wrong, _ = fixes(matched(200.0, bottom=ROUGH, fault=[fault]))
    clean, _ = fixes(matched(200.0, bottom=ROUGH))
    assert wrong.time.tolist() == clean.time.tolist() == [50.0, 100.0, 150.0, 200.0]
    assert wrong.faults.tolist() == [0, 0, 1, 0]
    moved = KINDS["terrain_match"].difference(wrong.value, clean.value)
    np.testing.assert_allclose(wrong.fault_error[2], moved[2], atol=1e-6)
    assert np.linalg.norm(wrong.fault_error[2]) > 0.2
    np.testing.assert_allclose(wrong.fault_error[[0, 1, 3]], 0.0)


def test_false_soundings_do_not_make_false_fixes() -> None:
    stream, error = fixes(matched(300.0, bottom=ROUGH, sounder={"false_readings": 0.08}), 3)
    assert len(stream) >= 4
    assert np.linalg.norm(error, axis=1).max() < 4.0


def test_there_is_no_fix_with_few_soundings_or_without_velocity() -> None:
    fault = {"kind": "outage", "instruments": ["dvl"], "start_s": 120.0, "end_s": 130.0}
    stream, _ = fixes(matched(200.0, bottom=ROUGH, fault=[fault]))
    assert stream.time.tolist() == [50.0, 100.0, 200.0]
    assert stream.dropped.tolist() == [150.0]
    few, _ = fixes(matched(100.0, bottom=ROUGH, match={"least_soundings": 51}))
    assert few.dropped.tolist() == [50.0, 100.0]


def test_a_reading_states_its_sigma_and_an_ideal_device_is_right() -> None:
    scenario = matched(150.0, bottom=ROUGH)
    real, perfect = simulate(scenario, 1), ideal(scenario, 1)
    sheet, stream = real.instruments["match"], real.data.aids["match"]
    assert (sheet.stated, sheet.sources) == (True, ("sounder",))
    np.testing.assert_array_equal(stream.side, stream.sigma)
    assert next(stream.measurements()).side.tolist() == stream.sigma[0].tolist()
    truth = perfect.data.truth
    place = truth.position[np.searchsorted(truth.time, stream.time - 1e-6), :2]
    np.testing.assert_allclose(
        KINDS["terrain_match"].difference(perfect.data.aids["match"].value, place), 0.0, atol=1e-6
    )


@pytest.mark.parametrize(
    ("match", "message"),
    [
        ({"sounder": "altimeter"}, "of kind 'altimeter' or 'multibeam_profile', which there is not; one of that kind"),
        ({"velocity": "log"}, "instruments.match: it reads 'log' of kind 'dvl', which there is not; one of that kind"),
        ({"velocity": "depth"}, "velocity = 'depth': should be an instrument of its own, but another key names it"),
        ({"heading": "compass"}, "'gyrocompass' or 'magnetic_compass', which there is not; one of that kind is 'gyroc"),
        ({"window_s": 0.0}, "window_s"),
        ({"window_s": 60.0}, "window_s = 60: should be at most 1 / rate_hz = 50 s; windows that overlap"),
        ({"search_m": 5.0}, "instruments.match: search_m = 5 is below the spacing of the chart; it should be 10 or"),
        ({"first_search_m": 8.0}, "first_search_m = 8 is below the spacing of the chart; it should be 10 or more"),
        ({"latitude_deg": 55.0}, "instruments.match: latitude_deg and longitude_deg: 55.0000 N, 7.9000 E is outside"),
        ({"uniqueness": 0.0}, "uniqueness"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(match: Any, message: str) -> None:
    with pytest.raises(SpecError, match=message.replace("(", r"\(")) as caught:
        matched(100.0, match=match)
    assert "\n" not in str(caught.value)


def test_the_place_of_the_beginning_is_two_numbers() -> None:
    with pytest.raises(SpecError, match="latitude_deg and longitude_deg of the beginning belong together"):
        TerrainMatch.from_toml({"latitude_deg": 54.0})
