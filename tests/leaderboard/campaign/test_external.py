"""Estimates that were made elsewhere: scored from files, blind exports, external rows of a board."""

from __future__ import annotations

import json

import numpy as np
import pytest

from simnav.estimator import make
from simnav.leaderboard.arguments import results_of
from simnav.leaderboard.campaign.external import add_external
from simnav.leaderboard.campaign.seal import PUBLIC, make_key
from simnav.leaderboard.logs import export, score_files
from simnav.leaderboard.ranking.confinement import confinement_line
from simnav.leaderboard.ranking.stored_costs import not_measured
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.hidden import without_truth
from simnav.leaderboard.results.recording_export import write_csv
from simnav.log import LogError
from simnav.scenario import parse
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial
from simnav.trial.estimate_file import trial_of_file

TOML = """
name = "external"
version = 1
title = "for files of estimates"
duration_s = 30.0

[start]
latitude_deg = 54.0
longitude_deg = 8.0
speed_m_s = 5.0

[instruments.gnss]
kind = "gnss_position"
sigma_m = 1.0

[instruments.gyrocompass]
sigma_deg = 0.5

[[fault]]
kind = "bias_step"
instruments = ["gnss"]
start_s = 10.0
end_s = 20.0
offset_m = [20.0, 0.0, 0.0]
"""


@pytest.fixture(scope="module")
def scenario():
    return parse(TOML)


@pytest.fixture(scope="module")
def recording(scenario):
    return record(scenario, 3)


def write(path, trial, sigma=True):
    """A trial as a file, with all digits."""
    header = "time_s,latitude_deg,longitude_deg,height_m,velocity_north_m_s,velocity_east_m_s,velocity_down_m_s"
    columns = [trial.time[:, None], np.degrees(trial.position[:, :2]), trial.position[:, 2:], trial.velocity]
    if sigma:
        header += ",sigma_north_m,sigma_east_m,sigma_down_m"
        header += ",sigma_velocity_north_m_s,sigma_velocity_east_m_s,sigma_velocity_down_m_s"
        columns.append(np.sqrt(np.diagonal(trial.covariance, axis1=1, axis2=2)[:, :6]))
    np.savetxt(path, np.hstack(columns), delimiter=",", header=header, comments="", fmt="%.17g")
    return path


def test_a_file_gets_the_scores_of_the_run_that_it_came_from(tmp_path, scenario, recording):
    trial = run_trial(make("gnss-only"), recording)
    report = score_files(scenario, [write(tmp_path / "mine.csv", trial)], seed=3)
    found, wanted = report.estimators[0].scores, score(trial, recording)
    for name in ("horizontal_rmse", "vertical_rmse", "velocity_horizontal_rmse", "nees_horizontal", "coverage_95"):
        assert found[name] == pytest.approx(wanted[name], rel=1e-6), name
    assert np.isnan(found.get("update_median", np.nan))  # nobody knows how long it took
    assert report.estimators[0].status == "ok"
    errors = report.trajectories["mine.csv"]
    assert errors.absolute == pytest.approx(np.hypot(wanted["horizontal_rmse"], wanted["vertical_rmse"]), rel=1e-5)
    assert errors.aligned < errors.absolute
    assert [r.pairs for r in errors.over_times] == [20, 0, 0]
    assert report.shown()[1].title.startswith("Root mean squares")
    assert report.to_dict()["trajectories"]["mine.csv"]["aligned"] == errors.aligned


def test_epochs_without_an_estimate_have_the_last_one(tmp_path, recording):
    truth = recording.data.truth
    lines = ["time_s,latitude_deg,longitude_deg"]
    for k in (9, 19, 29):
        lines.append(f"{truth.time[k]},{np.degrees(truth.position[k, 0]):.17g},{np.degrees(truth.position[k, 1]):.17g}")
    path = tmp_path / "rare.csv"
    path.write_text("\n".join(lines) + "\n")
    trial = trial_of_file(path, recording)
    assert trial.position[:9] == pytest.approx(np.tile(recording.start.position, (9, 1)))
    assert trial.position[9:19, :2] == pytest.approx(np.tile(truth.position[9, :2], (10, 1)), abs=1e-15)
    assert not trial.estimated[9:, 2:].any()


def test_a_file_that_ends_early_is_a_failed_run(tmp_path, recording):
    path = tmp_path / "short.csv"
    path.write_text("time_s,latitude_deg,longitude_deg\n1,54,8\n2,54,8\n")
    trial = trial_of_file(path, recording)
    assert (trial.status, len(trial)) == ("error", 3)
    assert "the file ends at 2 s, the run at 30 s" in trial.reason


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.mat", "", r"ends in \.csv or \.tum or \.txt"),
        ("a.csv", "t,lat,lon\n1,2,3\n", "the columns are t, lat, lon; wanted are time_s, latitude_deg"),
        ("a.csv", "time_s,latitude_deg,longitude_deg,hight_m\n1,2,3,4\n", "no meaning to the column 'hight_m'"),
        ("a.csv", "time_s,latitude_deg,longitude_deg\n1,2,x\n", r"line 2, column 'longitude_deg': 'x' is not a number"),
        ("a.csv", "time_s,latitude_deg,longitude_deg\n2,2,3\n1,2,3\n", r"line 3, column 'time_s': the time is before"),
        ("a.csv", "time_s,latitude_deg,longitude_deg\n1,54,8\n2,99,8\n", r"line 3: latitude_deg = 99 must be"),
        ("a.csv", "time_s,latitude_deg,longitude_deg,sigma_north_m\n1,54,8,-2\n", "sigma_north_m = -2 must be 0 or"),
        ("a.tum", "1 0 0 0 0 0 0\n", "7 columns without a header; TUM has 8"),
        ("a.tum", "1 0 0 0 0 0 0 0\n", r"line 1: a number is missing, or the quaternion is zero"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, recording, name, text, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(LogError, match=message):
        trial_of_file(path, recording)


def test_a_blind_recording_says_nothing(tmp_path, scenario, recording):
    blind = without_truth(recording)
    written = write_csv(blind, tmp_path)
    assert {p.name for p in written} == {"gnss.csv", "gyrocompass.csv", "README.md", "start.json"}
    text = "".join(p.read_text() for p in written)
    assert "fault" not in text.lower()
    assert "seed not told" in text
    truth = recording.data.truth.position[4, 0]
    assert f"{np.degrees(truth):.12f}"[:14] not in text
    told = json.loads((tmp_path / "start.json").read_text())
    assert {"seed", "draws", "faults"}.isdisjoint(told)
    assert told["start"]["position"] == pytest.approx(recording.start.position.tolist(), abs=1e-15)
    np.testing.assert_array_equal(blind.data.aids["gnss"].value, recording.data.aids["gnss"].value)
    for name in ("faults", "fault_error", "dropped"):
        assert not getattr(blind.data.aids["gnss"], name).any()
    np.testing.assert_array_equal(blind.data.truth.time, recording.data.truth.time)


def test_a_blind_export_needs_a_key(tmp_path, scenario):
    with pytest.raises(RequestError, match="'blind' needs 'sealed'"):
        export(scenario, tmp_path, blind=True)
    with pytest.raises(RequestError, match="exclude each other"):
        export(scenario, tmp_path, blind=True, truth=True)
    with pytest.raises(RequestError, match="format = 'xls' is unknown; there are: csv"):
        export(scenario, tmp_path, form="xls")


def test_an_export_says_the_seed_it_was_asked_for_and_no_truth(tmp_path, scenario):
    export(scenario, tmp_path / "open", seed=3)
    text = (tmp_path / "open" / "README.md").read_text()
    assert "seed 3" in text
    assert "simnav score SCENARIO --seed 3 FILE" in text
    assert not (tmp_path / "open" / "truth.csv").exists()
    assert "faults" not in (tmp_path / "open" / "start.json").read_text()
    export(scenario, tmp_path / "columns", seed=3, form="parquet")
    assert "| `gnss.parquet` |" in (tmp_path / "columns" / "README.md").read_text()


def test_external_rows_of_a_sealed_campaign(tmp_path, scenario):
    seal = make_key(tmp_path / "key")
    export(scenario, tmp_path / "lab", runs=2, blind=True, sealed=tmp_path / "key")
    home = tmp_path / "returned" / "their-filter"
    home.mkdir(parents=True)
    for number in range(2):
        fixes = np.loadtxt(tmp_path / "lab" / f"external-v1-{number}" / "gnss.csv", delimiter=",", skiprows=1)
        header = "time_s,latitude_deg,longitude_deg,height_m"
        np.savetxt(home / f"external-v1-{number}.csv", fixes, delimiter=",", header=header, comments="", fmt="%.17g")
    folder = store.create(tmp_path / "results")
    assert add_external(folder, tmp_path / "returned", [scenario], range(2), seal) == ["their-filter (external)"]
    results = results_of(folder)
    assert [(r.estimator, r.status, r.provenance.seal) for r in results] == [
        ("their-filter (external)", "ok", seal.hash)
    ] * 2
    for r in results:
        assert 1.0 < r.scores["horizontal_rmse"] < 20.0  # the seeds are those of the blind export
        assert r.note.startswith("external")
        assert r.provenance.confinement == "external"
    assert confinement_line(results) == "2 results were made elsewhere: nobody knows what their makers saw"
    assert not_measured(["ekf", "a (external)"]) == (
        "Cost not measured: ekf; 'simnav bench NAME' measures it. Cost not known, for the estimates were made "
        "elsewhere: a (external)."
    )
    with pytest.raises(RequestError, match=r"lacks 1 of 3 runs, such as external-v1-2\.csv"):
        add_external(folder, tmp_path / "returned", [scenario], range(3), PUBLIC)
    with pytest.raises(RequestError, match="has no file of the runs of this campaign"):
        add_external(folder, tmp_path / "returned", [scenario], range(7, 9), PUBLIC)
