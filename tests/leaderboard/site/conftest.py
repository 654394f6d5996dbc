"""A small site of made-up results, and of one scenario of the catalogue; built once."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from simnav.leaderboard.ranking.ranking import rank_tracks
from simnav.leaderboard.ranking.track_runs import runs_of_tracks
from simnav.leaderboard.results.provenance import BENCHMARK, Provenance
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.site import background, site
from simnav.leaderboard.site.sweeps import SweepFile
from simnav.scenario import load
from simnav.scoring import SCORES

HOSTILE = '"><script>alert(1)</script> & {{ 7 * 7 }}/../x'
SIZES = {"oracle": 1.0, "oracle-mixture": 1.0, "ekf": 2.4, "sw-fgo": 2.3, HOSTILE: 6.0, "inertial": 500.0}
MADE_UP = ("made-up-one-v1", "made-up-two-v3")
SEEDS = range(12)
MADE = Provenance(BENCHMARK, "c0ffee" * 6, True, "0.1.0", "3.11.7", "2.0", "0.60", "4.3", "Linux", "A processor", 2,
                  "namespaces", "2026-11-22")  # fmt: skip


def made_up(scenario: str, seed: int, estimator: str, status: str = "ok") -> Result:
    """A result whose error has the size of its estimator; the two oracles are the same."""
    kin = "oracle" if estimator.startswith("oracle") else estimator
    rng = np.random.default_rng([seed, len(scenario), len(kin)])
    time = np.linspace(1.0, 300.0, 60)
    error = SIZES[estimator] * rng.rayleigh(size=60)
    scores = dict.fromkeys(SCORES, math.nan)
    series = {}
    if status == "ok":
        known = {
            "horizontal_rmse": float(np.sqrt(np.mean(error**2))),
            "heading_rmse": math.radians(2.0),
            "availability": 1.0,
            "nees_horizontal": 0.5 * SIZES[estimator],
            "nees_horizontal_faulty": 1.0,
            "coverage_95": 0.95,
            "coverage_95_faulty": 0.95,
            "detection_rate": 0.9,
            "false_alarm_rate": 0.01 * SIZES[estimator],
            "update_median": 1e-4 * len(estimator),
        }
        scores |= {name: value for name, value in known.items() if name in scores}
        track = {"truth_north": time, "truth_east": 0.5 * time}
        track |= {"estimate_north": time + error, "estimate_east": 0.5 * time}
        series = {"time": time, "horizontal": error, "heading": error, "three_sigma": 3.0 * np.ones(60)}
        series |= {"quantiles": np.quantile(error, np.linspace(0.0, 1.0, 101)), **track}
        if estimator == "sw-fgo":
            series |= {"diagnostics_time": time[::3], "weight.gnss": rng.uniform(size=20)}
        series = {k: v.astype(np.float32) for k, v in series.items()}
    reason = "" if status == "ok" else f"<b>{status}</b> of {estimator}"
    parameters = {"gate": 3.5} if estimator == "ekf" else {}
    return Result(
        scenario,
        seed,
        estimator,
        parameters,
        kin == "oracle",
        status,
        reason,
        scores,
        series,
        "run <i>7</i>" if scenario in MADE_UP else "",
        1.5,
        2**20,
        scenario_digest="5ce",
        provenance=MADE,
        draws={} if scenario in MADE_UP else {"faults.0.size_m": 3.5, "faults.0.instruments": "dvl"},
    )


@pytest.fixture(scope="session")
def catalogued() -> str:
    """A scenario that can be recorded again, with faults."""
    return load("gnss-noise-step").id


@pytest.fixture(scope="session")
def hostile() -> str:
    """A name that would do harm if it were read as HTML, as a template or as a path."""
    return HOSTILE


@pytest.fixture(scope="session")
def results(catalogued: str) -> list[Result]:
    def status(scenario: str, seed: int, estimator: str) -> str:
        if estimator == "inertial" and scenario == MADE_UP[1]:
            return "unsuitable"
        return "timeout" if estimator == HOSTILE and seed == 2 else "ok"

    scenarios = (*MADE_UP, catalogued)
    return [made_up(s, k, e, status(s, k, e)) for s in scenarios for e in SIZES for k in SEEDS]


def made_up_sweep(scenario: str) -> SweepFile:
    """Of two rows, of which one breaks at 3 m."""

    def error(value: float) -> dict[str, float]:
        return {"value": value, "low": 0.9 * value, "high": 1.1 * value, "runs": 30}

    points = [
        {"estimator": e, "values": [v], "failed": 0, "error": error(1.0 + v * slope)}
        for e, slope in (("ekf", 1.0 / 3.0), ("sw-fgo", 0.1))
        for v in (0.0, 2.0, 4.0)
    ]
    broken = {"criterion": "twice-clean", "threshold": 2.0, "at": None}
    return SweepFile(
        Path("sweep-jump.json"),
        {
            "scenario": scenario,
            "score": {"name": "horizontal_rmse", "title": "Horizontal RMSE", "unit": "m"},
            "dials": [{"name": "jump", "key": "k", "unit": "m", "title": "Jump", "values": [0.0, 2.0, 4.0]}],
            "points": points,
            "breaking_points": [
                {"estimator": "ekf", **broken, "value": {"value": 3.0, "low": 2.5, "high": 3.5, "runs": 30}},
                {"estimator": "sw-fgo", **broken, "value": {"value": None, "low": None, "high": None, "runs": 30}},
            ],
        },
    )


@pytest.fixture(scope="session")
def folder(results: list[Result], catalogued: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site."""
    output = tmp_path_factory.mktemp("board") / "site"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(background, "BOUND_RUNS", 1)
        tracks = list(runs_of_tracks(results, tracks={catalogued: "fjords"}))  # two tracks under one heading
        index = site.build(results, rank_tracks(tracks), output, sweeps=[made_up_sweep(catalogued)], tracks=tracks)
    assert index == output / "index.html"
    return output
