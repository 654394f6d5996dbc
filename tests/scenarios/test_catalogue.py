"""The scenarios of the catalogue: each loads, is itself, and carries the figures of the paper that it follows."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from simnav.estimator import make
from simnav.scenario import Scenario, load
from simnav.scenario.catalogue import Header, headers
from simnav.source import record
from simnav.types import InitialState
from tests.cases.sorts_of_scenarios import OF_EVERY_SORT, used

FOLDER = Path(__file__).resolve().parents[2] / "scenarios"
CATALOGUE = [h for h in headers() if h.path.is_relative_to(FOLDER)]
SIMULATED = [h for h in CATALOGUE if not h.recorded]


def test_the_catalogue_is_complete():
    assert {h.path for h in CATALOGUE} == {*FOLDER.glob("*.toml"), *FOLDER.glob("families/*.toml")}
    # Issue 2, item 5, and the paper that each of the six follows.
    wanted = {"open-sea", "coastal-voyage", "gnss-noise-step", "ship-dead-reckoning", "uuv-surface", "auv-survey"}
    assert wanted <= {h.name for h in CATALOGUE}


def test_ids_are_unique():
    assert len({h.id for h in CATALOGUE}) == len({h.gym_id for h in CATALOGUE}) == len(CATALOGUE)


@pytest.mark.parametrize("header", CATALOGUE, ids=lambda h: h.id)
def test_every_scenario_loads_and_is_what_its_head_says(header: Header):
    scenario = load(header.id)
    assert (scenario.id, scenario.gym_id) == (header.id, header.gym_id)
    assert (scenario.duration, scenario.title, scenario.tags) == (header.duration, header.title, header.tags)
    assert (scenario.track, scenario.group, scenario.recorded) == (header.track, header.group, header.recorded)
    assert header.channels == any(spec.channels() for spec in scenario.aids.values())
    assert header.path.stem in (scenario.name, scenario.id)


@pytest.mark.parametrize("header", CATALOGUE, ids=lambda h: h.id)
def test_every_scenario_survives_the_way_to_toml_and_back(header: Header):
    scenario = load(header.path)
    assert scenario.id == header.id
    again = Scenario.from_toml(scenario.to_toml())
    assert again == scenario
    assert again.content_hash() == scenario.content_hash()


@pytest.mark.parametrize("header", CATALOGUE, ids=lambda h: h.id)
def test_every_scenario_tells_its_reader_what_it_is(header: Header):
    scenario = load(header.id)
    assert len(scenario.title) < 80
    assert len(scenario.description) > 80
    assert scenario.recorded or re.search(r"^ours\b|\b20\d\d\b", scenario.source)
    assert scenario.source
    assert scenario.tags
    tracks = {
        "aided-ins",
        "no-imu",
        "underwater",
        "long",
        "generalisation",
        "generalisation-no-imu",
        "recorded",
        "papers",
        "robustness",
        "coloured",
        "satellites",
        "acoustic",
        "terrain",
        "cooperative",
        "alignment",
    }
    assert scenario.track in tracks | {"training"}
    assert scenario.training == header.training == (scenario.track == "training")
    assert scenario.group != "other"


@pytest.mark.parametrize("header", SIMULATED, ids=lambda h: h.id)
def test_simulated_scenarios_suit_a_quick_campaign(header: Header):
    scenario = load(header.id)
    assert scenario.duration <= 1000.0 or "long" in scenario.tags
    assert all(fault.start < scenario.duration for fault in scenario.faults)
    # The last fault leaves time to recover, unless it is meant to last.
    assert all(fault.end <= scenario.duration or math.isinf(fault.end) for fault in scenario.faults)


@pytest.mark.parametrize("header", SIMULATED, ids=lambda h: h.id)
def test_nobody_can_tune_to_a_fault(header: Header):
    """But for the papers' runs, no fault of two runs has the same size and the same times."""
    scenario = load(header.id)
    if scenario.track == "papers":
        return
    drawn = [scenario.drawn(seed) for seed in range(12)]
    for i in range(min(len(s.faults) for s in drawn)):
        content = [s.faults[i].model_dump_json() for s in drawn]
        assert len(set(content)) == len(content), scenario.faults[i]


@pytest.mark.parametrize("header", CATALOGUE, ids=lambda h: h.id)
def test_unit_keys_are_as_a_person_types_them(header: Header):
    """A figure in radians or in metres per second squared slipped into a TOML file would be far out of these ranges."""
    sheets = load(header.id).instruments_sheet()
    if sheets.imu is not None:
        assert 1e-8 < sheets.imu.gyroscope.bias + sheets.imu.gyroscope.bias_instability < 1e-2
        assert 1e-6 < sheets.imu.accelerometer.bias + sheets.imu.accelerometer.bias_instability < 1.0
        assert sheets.imu.rate >= 10.0
    for sheet in sheets.values():
        low, high = {"magnetic_compass": (1e-4, 0.1), "gyrocompass": (1e-4, 0.1)}.get(sheet.kind, (1e-4, 60.0))
        assert np.all((sheet.sigma >= low) & (sheet.sigma <= high)), (sheet.name, sheet.sigma)


def test_open_sea_is_matched_and_clean():
    scenario = load("open-sea")
    sheets = scenario.instruments_sheet()
    assert scenario.faults == ()
    assert sheets.imu is not None
    for triad in (sheets.imu.gyroscope, sheets.imu.accelerometer):
        assert triad.bias_instability == triad.scale == triad.misalignment == triad.quantization == 0.0
    for sheet in sheets.values():
        assert not np.any(sheet.bias)
        assert not np.any(sheet.bias_instability)
        assert sheet.scale == 0.0
        assert not np.any(sheet.misalignment)
    # Nothing that a datasheet does not tell, either.
    for spec in scenario.aids.values():
        assert not any(np.any(getattr(spec, name)) for name in type(spec).model_fields if name.startswith("fixed_"))


def test_paper_000():
    scenario = load("coastal-voyage")
    sheets = scenario.instruments_sheet()
    assert scenario.duration == 6000.0
    assert sheets.imu is not None
    assert sheets.imu.rate == 100.0
    # 2.5 m CEP of a circular normal distribution: sigma = CEP / sqrt(2 ln 2).
    np.testing.assert_allclose(sheets["gnss"].sigma[:2], 2.5 / math.sqrt(2.0 * math.log(2.0)), atol=0.005)
    np.testing.assert_allclose(sheets["dvl"].sigma, 0.008)
    assert sheets["gnss"].rate == sheets["dvl"].rate == 1.0
    assert {(f.start, f.end) for f in scenario.faults} == {(3200.0, 4800.0)}


def test_paper_001():
    scenario = load("gnss-noise-step")
    sheets = scenario.instruments_sheet()
    assert scenario.duration == 320.0
    (fault,) = scenario.faults
    assert (fault.kind, fault.start, fault.end) == ("noise_step", 160.0, 240.0)
    np.testing.assert_allclose(sheets["gnss"].sigma, 1.0)
    np.testing.assert_allclose(sheets["gnss"].sigma * fault.factor, 10.0)
    # Table 1.
    assert sheets.imu is not None
    assert sheets.imu.gyroscope.random_walk == pytest.approx(math.radians(0.4) / 60.0)
    assert sheets.imu.gyroscope.bias == pytest.approx(math.radians(8.0) / 3600.0)
    assert sheets.imu.accelerometer.bias == pytest.approx(30e-6 * 9.80665)
    assert sheets.imu.accelerometer.random_walk == pytest.approx(0.02 / 60.0, rel=0.01)


def test_paper_002():
    for name in ("ship-dead-reckoning", "ship-straight", "ship-turn", "ship-field"):
        sheets = load(name).instruments_sheet()
        assert sheets.imu is None
        assert {s.kind for s in sheets.values()} == {"gnss_position", "gyrocompass", "speed_log"}
        assert all(s.rate == 1.0 for s in sheets.values())
    faults = load("ship-dead-reckoning").faults
    assert [(f.kind, f.start, f.end) for f in faults] == [("outage", 500.0, 560.0), ("outage", 1100.0, 1160.0)]


def test_paper_002_field():
    """An hour, about 6.5 m/s, -3.4e-4 m/s^2, heading from 294 to 280 deg, 60 s without GNSS at 400 and 900 s."""
    scenario = load("ship-field")
    assert [(f.kind, f.start, f.end) for f in scenario.faults] == [("outage", 400.0, 460.0), ("outage", 900.0, 960.0)]
    assert scenario.duration == 3600.0
    truth = record(scenario, 0).data.truth
    heading = np.degrees(truth.attitude[:, 2]) % 360.0
    assert (heading[0], heading[-1]) == pytest.approx((294.0, 280.0), abs=0.1)
    water = load("ship-field").current.speed * np.array([math.cos(math.radians(40.0)), math.sin(math.radians(40.0))])
    speed = np.hypot(*(truth.velocity[:, :2] - water).T)
    slope, level = np.polyfit(truth.time - 1800.0, speed, 1)
    assert slope == pytest.approx(-3.4e-4, rel=0.05)
    assert level == pytest.approx(6.5, abs=0.05)


def test_paper_001_road():
    """The real drive of car-kitti, on which the noise of the fixes changes twice."""
    road, drive = load("car-road"), load("car-kitti")
    assert road.recorded
    assert road.log is not None
    assert drive.log is not None
    assert (road.log.imu, road.log.files, road.log.origin) == (drive.log.imu, drive.log.files, drive.log.origin)
    assert [f.kind for f in road.faults] == ["noise_step", "gross_error"]


def test_paper_003():
    scenario = load("uuv-surface")
    sheets = scenario.instruments_sheet()
    assert scenario.duration == 2400.0
    assert scenario.start is not None
    assert scenario.start.speed * scenario.duration == pytest.approx(4011.0, abs=1.0)
    assert sheets.imu is not None
    assert sheets.imu.gyroscope.bias == pytest.approx(math.radians(0.01) / 3600.0)
    assert sheets.imu.accelerometer.bias == pytest.approx(1000e-6 * 9.80665)
    np.testing.assert_allclose(sheets["dvl"].sigma, 0.005)
    assert sheets["dvl"].scale == pytest.approx(0.0255)
    np.testing.assert_allclose(np.degrees(sheets["dvl"].misalignment), [0.028, 0.010, 0.266])
    disturbance, positions, velocities = scenario.faults
    assert (disturbance.start, disturbance.end, disturbance.specific_force) == (0.0, 500.0, (0.5, 0.5, 0.5))
    assert (positions.start, positions.end, positions.size_position) == (500.0, 2400.0, (1.0, 60.0))
    assert velocities.size_velocity == (0.5, 1.0)


def test_paper_004():
    scenario = load("auv-survey")
    sheets = scenario.instruments_sheet()
    intervals = {name: 1.0 / sheet.rate for name, sheet in sheets.items()}
    assert intervals == pytest.approx({"dvl": 1.0, "terrain_fix": 3.0, "magnetic_compass": 0.5, "depth": 2.0})
    outages = {f.instruments[0]: (f.start, f.end) for f in scenario.faults}
    assert outages == {
        "dvl": (150.0, 350.0),
        "terrain_fix": (250.0, 400.0),
        "magnetic_compass": (800.0, 850.0),
        "depth": (650.0, 700.0),
    }


def test_the_bias_fills_the_window():
    (fault,) = load("window-bias").faults
    assert fault.kind == "bias_step"
    assert fault.end - fault.start == 100.0
    assert np.linalg.norm(fault.offset_position) == pytest.approx(25.0, abs=0.01)


def test_the_catalogue_is_packaged():
    """The wheel takes the files that pyproject.toml names."""
    with (FOLDER.parent / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)
    assert project["tool"]["setuptools"]["package-data"]["simnav.scenarios"] == [
        "*.toml",
        "families/*.toml",
        "recordings/*.toml",
    ]
    assert project["project"]["entry-points"]["simnav.scenarios"] == {"simnav": "simnav.scenarios"}


@pytest.mark.parametrize(
    "track",
    [
        "aided-ins",
        "no-imu",
        "underwater",
        "long",
        "generalisation",
        "generalisation-no-imu",
        "robustness",
        "satellites",
        "acoustic",
        "terrain",
        "cooperative",
    ],
)
def test_a_track_has_an_estimator_that_suits_all_of_it(track: str):
    """The ranking takes full coverage only."""
    row = "ship-ekf" if "no-imu" in track else "ekf"
    scenarios = [load(header.id) for header in SIMULATED if header.track == track]
    assert scenarios
    for scenario in scenarios:
        for seed in range(3):
            run = scenario.drawn(seed)
            start = InitialState(0.0, np.zeros(3), np.zeros(3), np.zeros(3), run.initial_error.covariance())
            make(row).reset(start, run.instruments_sheet())


def test_a_lone_dvl_is_never_wrong():
    """The IMU is disturbed for about a second after GNSS has ended, and the DVL is as its datasheet says."""
    run = record(load("lone-dvl"), 2)
    cut = next(f for f in run.faults if f.kind == "outage")
    assert run.data.aids["gnss"].time[-1] < cut.start
    assert not run.data.aids["dvl"].faults.any()
    disturbed = run.data.imu.time[run.data.imu_labels.faults != 0]
    assert cut.start < disturbed[0]
    assert 0.6 < disturbed[-1] - disturbed[0] < 1.4


def test_one_datasheet_is_wrong_and_the_others_are_true():
    scenario = load("one-wrong-datasheet")
    wrong = set()
    for seed in range(20):
        run = scenario.drawn(seed)
        true, said = run.actual_sheet(), run.instruments_sheet()
        sigma = {name: (true[name].sigma, said[name].sigma) for name in said}
        sigma |= {
            n: (getattr(true.imu, n).random_walk, getattr(said.imu, n).random_walk)
            for n in ("gyroscope", "accelerometer")
        }
        differ = [name for name, (a, b) in sigma.items() if not np.array_equal(a, b)]
        assert differ == [run.draws["draw.wrong"]]
        wrong |= set(differ)
    assert wrong == {"gnss", "dvl", "gyrocompass", "gyroscope", "accelerometer"}


def test_what_any_simulated_scenario_uses_one_of_the_sorts_uses():
    """Tests that take these for all others would miss what a new scenario brings."""
    tested = set().union(*(used(load(name)) for name in OF_EVERY_SORT))
    missed = {h.name: used(load(h.name)) - tested for h in CATALOGUE if not h.recorded}
    assert {name: what for name, what in missed.items() if what} == {}
    assert tested - used(load("open-sea"))
