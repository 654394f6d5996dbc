"""Profiles: what they hold, what is wrong with one, and that a campaign runs one."""

from __future__ import annotations

from pathlib import Path

import pytest

import simnav
from simnav.estimator import describe, find, names
from simnav.leaderboard.profiles import Part, profiles, read_profile
from simnav.leaderboard.results.errors import RequestError
from simnav.scenario.catalogue import headers


def test_the_profiles_that_come_with_simnav():
    assert profiles() == ["coloured", "full", "quick", "robustness", "satellites", "smoke", "standard", "terrain"]
    known, rows = {h.name: h for h in headers()}, names()
    for name in profiles():
        profile = read_profile(name)
        assert profile.title.startswith(name)
        for part in profile.parts:
            assert set(part.scenarios) <= known.keys()
            assert set(part.estimators) <= set(rows)
            assert len(set(part.estimators)) == len(part.estimators)
    sizes = {name: read_profile(name).results for name in profiles()}
    assert sizes["smoke"] < sizes["quick"] < sizes["standard"] < sizes["full"]


def test_quick_has_few_rows_and_seeds_enough_to_decide():
    profile = read_profile("quick")
    assert len({e for p in profile.parts for e in p.estimators}) <= 20
    assert all(p.runs == 10 and len(p.estimators) > 5 for p in profile.parts)
    assert not any(describe(e).slow for p in profile.parts for e in p.estimators)


def test_standard_has_the_same_seeds_for_all_rows_of_a_track():
    known = {h.name: h for h in headers()}
    ranked = [h for h in headers() if not h.training]
    most: dict[tuple[str, str], int] = {}
    for part in read_profile("standard").parts:
        for scenario in part.scenarios:
            for row in part.estimators:
                most[scenario, row] = max(part.runs, most.get((scenario, row), 0))
    assert {s for s, _ in most} == {h.name for h in ranked if h.track != "alignment"}
    chosen = {row for (scenario, row) in most if known[scenario].track in ("papers", "long")}
    assert 20 <= len(chosen) <= 25
    loose = {n for n in names() if getattr(find(n), "loose", False)}
    special = {"satellites": loose, "acoustic": loose, "cooperative": {"ekf-ci"}, "terrain": loose | {"terrain-pmf"},
               "robustness": {"mh-ekf"}}  # fmt: skip
    with_chosen = {
        "papers": 10, "long": 10, "coloured": 8, "robustness": 30, "satellites": 30, "acoustic": 30, "cooperative": 30,
        "terrain": 30,
    }  # fmt: skip
    slow = {"terrain-pmf"}  # the only row that matches soundings with the chart by itself
    assert {row for _, row in most} == slow | {n for n in names() if not describe(n).slow}
    for (scenario, row), runs in most.items():
        track = known[scenario].track
        assert runs == (6 if scenario == "twelve-hours" else with_chosen.get(track, 30))
        assert track not in with_chosen or row in chosen | special.get(track, set())


def test_a_profile_of_ones_own(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text('[[part]]\nscenarios = ["open-sea"]\nestimators = ["ekf"]\nruns = 3\n')
    assert read_profile(file).parts == (Part(("open-sea",), ("ekf",), 3),)
    for text, says in (
        ("", r"tables \[\[part\]\]"),
        ('[[part]]\nscenarios = ["a"]\nruns = 0', "runs = 0 should be a number of seeds"),
        (
            '[[part]]\nscenarios = ["a"]\nruns = 1000000000000',
            "runs = 1000000000000 should be a number of seeds, from 1",
        ),
        ('[[part]]\nscenarios = ["a"]\nruns = 30\nmore = 50', r"more = 50 should be one of \(100, 300\)"),
        ('[[part]]\nscenarios = ["a"]\nruns = 30\nmore = true', "more = True should be one of"),
        ('[[part]]\ntracks = ["a"]\nruns = 1\nlongest_s = "x"', "longest_s = 'x' should be a number of seconds"),
        ('[[part]]\ntracks = ["a"]\nruns = 1\nshortest_s = nan', "shortest_s = nan should be a number of seconds"),
        ("[[part]]\nruns = 1", "name scenarios or tracks"),
        ('[[part]]\nscenario = ["a"]\nruns = 1', "'scenario' is no key of a part; did you mean 'scenarios'"),
        ('[[part]]\nscenarios = "a"\nruns = 1', "should be a list of names"),
        ('[[part]]\nscenarios = ["a"]\nestimators = "few"\nruns = 1', "there is no group 'few' of estimators"),
        ('[groups]\nfew = "ekf"\n[[part]]\nscenarios = ["a"]\nruns = 1', "few = 'ekf' should be a list of names"),
        ("[[part]", "mine.toml"),
    ):
        file.write_text(text)
        with pytest.raises(RequestError, match=says):
            read_profile(file)
    with pytest.raises(RequestError, match="no profile 'quik'; did you mean 'quick'"):
        read_profile("quik")


def test_a_profile_with_a_former_name_of_a_parameter_runs_the_row(tmp_path: Path):
    pond = (Path(__file__).parents[1] / "cases" / "pond.toml").as_posix()
    file = tmp_path / "mine.toml"
    file.write_text(f'[[part]]\nscenarios = ["{pond}"]\nestimators = ["iae-fixed:window=9"]\nruns = 1\n')
    (result,) = (
        r for r in simnav.campaign(profile=file, output=tmp_path / "out", workers=1).results if not r.reference
    )
    assert (result.estimator, result.parameters) == ("iae-fixed(innovations=9)", {"innovations": "9"})


def test_a_campaign_runs_the_parts_of_a_profile(tmp_path: Path):
    pond = (Path(__file__).parents[1] / "cases" / "pond.toml").as_posix()
    file = tmp_path / "mine.toml"
    file.write_text(
        f'[[part]]\nscenarios = ["{pond}"]\nestimators = ["gnss-only"]\nruns = 2\n'
        f'[[part]]\nscenarios = ["{pond}"]\nestimators = ["gnss-only"]\nruns = 3\n'
    )
    report = simnav.campaign(profile=file, output=tmp_path / "out", workers=1)
    assert (len(report.results), report.summary.computed, report.summary.total) == (6, 6, 10)
    assert {r.estimator for r in report.results if r.reference} == {"oracle"}  # which is added
