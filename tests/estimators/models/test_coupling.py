"""Raw observations beside the receiver that solves them: each solver uses one of them."""

from __future__ import annotations

import pytest

from simnav.estimator import EstimatorError, UnsuitableScenario, lacking, make
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.models.ship import ShipModel
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial
from tests.cases.raw_gnss import raw_gnss

RECEIVER = """
[instruments.fix]
kind = "gnss_receiver"
observations = "gnss"
sigma_m = [0.5, 0.5, 1.0]
bias_instability_m = [1.0, 1.0, 3.0]
correlation_time_s = 600.0
[instruments.doppler]
kind = "gnss_receiver_velocity"
observations = "gnss"
sigma_m_s = [0.04, 0.04, 0.08]
"""


@pytest.fixture(scope="module")
def recording():
    return record(raw_gnss(4.0, RECEIVER), 1)


def test_a_model_with_states_takes_the_raw_observations(recording):
    found = by_source(recording.instruments, InertialModel(), "ekf")
    assert set(found) == {f"gnss:{s}" for s in recording.instruments["gnss"].channels}
    assert by_source(found, InertialModel(), "ekf").keys() == found.keys()


def test_a_model_without_states_takes_the_receiver(recording):
    assert set(by_source(recording.instruments, NineStateModel(), "ekf-9")) == {"fix", "doppler"}
    raw = recording.instruments.without({"fix", "doppler"})
    assert set(by_source(raw, NineStateModel(), "ekf-9")) == {f"gnss:{s}" for s in raw["gnss"].channels}


@pytest.mark.parametrize(
    ("name", "used"),
    [("ekf", "gnss"), ("sw-fgo", "gnss"), ("imm", "gnss"), ("oracle", "gnss"), ("ekf-loose", "fix"), ("kf-9", "fix")],
)
def test_a_row_reports_of_one_of_them_only(recording, name, used):
    trial = run_trial(make(name), recording)
    assert trial.status == "ok", trial.reason
    told = {label.partition(".")[2].partition(":")[0] for label in trial.diagnostics if "." in label}
    told &= set(recording.instruments)
    assert told == ({"gnss"} if used == "gnss" else {"fix", "doppler"})


@pytest.mark.parametrize(
    ("model", "used"), [(InertialModel(), {"beams"}), (ShipModel(), {"solution"}), (NineStateModel(), {"solution"})]
)
def test_a_model_takes_the_beams_of_a_dvl_or_what_they_give(model, used):
    instruments = load("lawnmower-beams").instruments_sheet()
    assert {name.partition(":")[0] for name in by_source(instruments, model, "row")} & {"beams", "solution"} == used
    # Without the solution the beams are taken, as far as the model suits them.
    raw = load("lawnmower-beams").instruments_sheet().without({"solution"})
    if not isinstance(model, ShipModel):
        assert "beams:1" in by_source(raw, model, "row")


@pytest.mark.parametrize(
    ("model", "used"), [(InertialModel(), {"sounder"}), (InertialModel(calibrate=False), {"matching"})]
)
def test_a_model_takes_soundings_or_the_fixes_that_a_computer_makes_of_them(model, used):
    instruments = load("terrain-matching").instruments_sheet()
    found = {name.partition(":")[0] for name in by_source(instruments, model, "row")}
    assert found == used | {"dvl", "depth", "gyrocompass"}  # these tell the track, and are used beside the fixes
    assert instruments["matching"].stated


def test_the_receiver_beside_raw_observations_changes_no_bit(recording):
    both = run_trial(make("ekf"), recording)
    alone = run_trial(make("ekf"), record(raw_gnss(4.0), 1))
    assert both.position.tobytes() == alone.position.tobytes()


def test_any_row_is_loosely_coupled_on_request(recording):
    asked, named = (run_trial(made, recording) for made in (make("ekf", loose="true"), make("ekf-loose")))
    assert asked.position.tobytes() == named.position.tobytes()
    assert run_trial(make("ekf", loose=False), recording).position.tobytes() != named.position.tobytes()
    with pytest.raises(EstimatorError, match="parameter 'loose' is true or false, not 2"):
        make("ekf", loose=2)


def test_a_loosely_coupled_row_needs_a_receiver():
    instruments = record(raw_gnss(2.0), 1).instruments
    assert lacking(make("ekf-loose").needs, instruments) == (
        "it needs gnss_receiver or dvl_solution or dvl_water_solution or terrain_match; there is none"
    )
    assert not lacking(make("ekf").needs, instruments)
    with pytest.raises(UnsuitableScenario):
        make("ekf-loose").reset(record(raw_gnss(2.0), 1).start, instruments.without({"gnss"}))
