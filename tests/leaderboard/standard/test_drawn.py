"""What the site of the standard result draws beside scores: kept small, beside the results of its versions only."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from simnav.leaderboard.ranking.superseded import version_of
from simnav.leaderboard.results import store
from simnav.leaderboard.results.packing import write_packed
from simnav.leaderboard.results.provenance import BENCHMARK, Provenance
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.results.versions import declared
from simnav.leaderboard.site.background import Background, background
from simnav.leaderboard.standard import backgrounds, drawing, drawn
from simnav.leaderboard.standard.backgrounds import keep_backgrounds, stored_backgrounds
from simnav.leaderboard.standard.drawn import attached, keep, stored_sweeps
from simnav.simulation.version import SIMULATOR_VERSION

#: A scenario whose recording and bound take little time.
SHORT = "gnss-noise-step-v1"
PROFILE = """
title = "small"
[[part]]
scenarios = ["clean-voyages"]
estimators = ["ekf"]
runs = 2
[[sweep]]
scenario = "clean-voyages"
dials = ["size=0,1"]
estimators = ["ekf", "gnss-only"]
runs = 3
"""


def result(estimator: str, seed: int, series: bool = True) -> Result:
    """A result of today's version whose error grows."""
    time = np.linspace(0.0, 239.7, 500)
    found = {
        "time": time, "horizontal": 0.0123456 * time, "north": time, "estimate_north": 3.21 * time,
        "quantiles": np.linspace(0.0, 3.0, 101), "diagnostics_time": time[::5], "nis.gnss": np.full(100, np.nan),
    } if series else {}  # fmt: skip
    made = Result(
        "clean-voyages-v1", seed, estimator, {}, False, "ok", "", {"horizontal_rmse": 1.5},
        {name: values.astype(np.float32) for name, values in found.items()}, provenance=Provenance(BENCHMARK),
        estimator_version=version_of(estimator) or 1,
    )  # fmt: skip
    (addressed,) = declared([made])
    return addressed


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A folder of results with series, and what is kept of it."""
    (tmp_path / "small.toml").write_text(PROFILE)
    write_packed([result(e, seed) for e in ("ekf", "gnss-only") for seed in range(3)], tmp_path / "work")
    assert keep([tmp_path / "work"], tmp_path / "drawn", drawing.read_profile(tmp_path / "small.toml")) == 4
    return tmp_path


def test_curves_of_named_rows_and_quantiles_of_others_are_kept(home: Path) -> None:
    kept = {(r.estimator, r.seed): r.series for r in store.load(home / "drawn" / "curves")}
    assert kept.keys() == {("ekf", 0), ("ekf", 1), ("gnss-only", 0), ("gnss-only", 1)}
    assert list(kept["gnss-only", 1]) == ["quantiles"]
    curve = kept["ekf", 0]
    assert "north" not in curve
    assert len(curve["time"]) <= 121
    assert curve["time"][-1] == pytest.approx(239.7)  # the end of the run
    np.testing.assert_allclose(curve["horizontal"], 0.0123456 * curve["time"], rtol=1e-3)
    np.testing.assert_allclose(curve["estimate_north"], 3.21 * curve["time"], atol=0.07)
    assert np.isnan(curve["nis.gnss"]).all()


def test_results_without_series_get_those_of_their_version(home: Path) -> None:
    old = replace(result("gnss-only", 1, series=False), estimator_version=7)
    bare = [result("ekf", 0, series=False), result("ekf", 2, series=False), *declared([old])]
    write_packed(bare, home / "bare")
    found, seeds = attached(store.load(home / "bare"), home / "drawn")
    assert seeds == {"clean-voyages-v1": [0]}
    assert [bool(r.series) for r in found] == [True, False, False]
    assert found[0].scores == bare[0].scores
    own, none = attached(store.load(home / "work"), home / "drawn")  # they have series of their own
    assert none == {}
    assert len(own[0].series["time"]) == 500


def test_what_is_of_another_version_is_dropped_when_it_is_kept_again(home: Path, monkeypatch) -> None:
    from simnav.leaderboard.standard import outdated_results

    monkeypatch.setattr(outdated_results, "version_of", lambda name: 9 if name == "ekf" else 1)
    assert keep([], home / "drawn") == 2
    assert {r.estimator for r in store.load(home / "drawn" / "curves")} == {"gnss-only"}


def made_up(identity: str, seeds: range) -> Background:
    """What is known of a recording, without simulating it."""
    return Background(
        bound={"time": [0.0, 240.0], "bound": [1.0, float(len(identity))]}, runs={str(s): {} for s in seeds}
    )


def test_recordings_and_bounds_are_made_once_and_are_shown_in_their_versions_only(home: Path, monkeypatch) -> None:
    monkeypatch.setattr(backgrounds, "background", made_up)
    asked, results, folder = {"clean-voyages-v1", "open-sea-v1"}, store.load(home / "work"), home / "drawn"
    assert keep_backgrounds(asked, folder, end=0.0) == (0, 2)
    assert keep_backgrounds(asked, folder) == (2, 0)
    assert keep_backgrounds(asked, folder) == (0, 0)
    assert stored_backgrounds(results, folder) == {"clean-voyages-v1": made_up("clean-voyages-v1", range(1))}
    assert stored_backgrounds([replace(r, recording="of-a-digest") for r in results], folder) == {}
    assert keep_backgrounds({"clean-voyages-v1"}, folder) == (0, 0)
    assert [file.stem for file in (folder / "backgrounds").iterdir()] == ["clean-voyages-v1"]
    monkeypatch.setattr(backgrounds, "version_of", lambda name: 99)
    assert stored_backgrounds(results, folder) == {}
    assert keep_backgrounds({"clean-voyages-v1"}, folder) == (1, 0)
    assert len(stored_backgrounds(results, folder)) == 1


def test_draw_runs_what_is_missing_and_sweeps_that_are_of_other_versions(home: Path, monkeypatch) -> None:
    monkeypatch.setattr(backgrounds, "background", made_up)
    asked = []

    class Swept:
        summary = type("Summary", (), {"computed": 12})

        def to_dict(self) -> dict:
            error = {"value": 1.0, "low": 0.5, "high": 2.0, "runs": 3}
            points = [{"estimator": e, "values": [v], "failed": 0, "error": error} for e in ("ekf", "gnss-only")
                      for v in (0.0, 1.0)]  # fmt: skip
            dial = {"name": "size", "key": "k", "unit": "m", "title": "size", "values": [0.0, 1.0]}
            return {"scenario": "clean-voyages-v1", "score": {"title": "RMSE", "unit": "m"}, "dials": [dial],
                    "points": points, "breaking_points": []}  # fmt: skip

    def sweep(*given: object, **options: object) -> Swept:
        asked.append(given)
        return Swept()

    monkeypatch.setenv("SIMNAV_CONFINEMENT", "none")

    def draw() -> drawing.Drawing:
        return drawing.draw(home / "small.toml", home / "again", home / "work", home / "drawn", sweep=sweep, workers=1)

    made = draw()  # both curves were kept, so that nothing is run for them
    assert (made.results, made.sweeps, made.backgrounds, made.computed, made.left) == (4, 1, 1, 13, 0)
    assert asked == [("clean-voyages", ["size=0,1"], ["ekf", "gnss-only"])]
    assert draw().computed == 0
    results = store.load(home / "work")
    (shown,) = stored_sweeps(results, home / "drawn")
    assert shown.rows == ["ekf", "gnss-only"]
    file = home / "drawn" / "sweeps" / "sweep-clean-voyages.json"
    content = json.loads(file.read_text())
    file.write_text(json.dumps(content | {"versions": {"ekf": 9, "gnss-only": content["versions"]["gnss-only"]}}))
    assert [s.rows for s in stored_sweeps(results, home / "drawn")] == [["gnss-only"]]
    file.write_text(json.dumps(content | {"simulator": SIMULATOR_VERSION + 1}))
    assert stored_sweeps(results, home / "drawn") == []
    assert draw().computed == 12


def test_the_profile_that_comes_with_simnav_names_what_there_is() -> None:
    from simnav.leaderboard.sweep.settings import chosen_dials, parse_dials
    from simnav.scenario import load

    assert drawing.read_profile(drawn.PROFILE).results < 1200
    for one in drawn.asked_sweeps():
        assert chosen_dials(load(one.scenario), parse_dials(list(one.dials)))


def test_what_comes_with_simnav_is_what_the_code_of_today_makes_of_a_recording() -> None:
    content = json.loads((drawn.DRAWN / "backgrounds" / f"{SHORT}.json").read_bytes())
    assert_same(content["background"], json.loads(json.dumps(asdict(background(SHORT, range(1))))))


def assert_same(stored: object, made: object) -> None:
    """The same words, and numbers but for what another processor rounds."""
    if isinstance(stored, dict) and isinstance(made, dict):
        assert stored.keys() == made.keys()
        for key, value in stored.items():
            assert_same(value, made[key])
    elif isinstance(stored, list) and isinstance(made, list):
        assert len(stored) == len(made)
        for one, other in zip(stored, made, strict=True):
            assert_same(one, other)
    else:
        assert stored == (pytest.approx(made, rel=1e-3, abs=1e-3) if isinstance(made, float) else made)
