"""The files of scenarios outside the catalogue travel with the results that were made on them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import simnav
from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.campaign.verification import verify_results
from simnav.leaderboard.results import scenario_files, store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.gathering import gather
from simnav.leaderboard.results.packing import pack
from simnav.scenario import load, parse
from tests.cases import POND


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("results") / "out"
    scenario = parse(f'track = "ponds"\n{POND}')
    short = load("ship-straight").model_copy(update={"duration": 20.0})
    row = EstimatorRequest("gnss-only")
    run_campaign([scenario, short], [row], [0, 1], folder, workers=1, confinement="none")
    return folder


def test_only_what_the_catalogue_lacks_has_a_file(results: Path):
    assert [p.name for p in (results / scenario_files.FOLDER).iterdir()] == ["pond-v1.toml"]
    again = scenario_files.load(results, "pond-v1")
    assert again is not None
    assert (again.track, again.to_toml()) == ("ponds", parse(f'track = "ponds"\n{POND}').to_toml())
    assert scenario_files.load(results, "lake-v1") is None


def test_a_colleague_has_the_track_and_can_repeat_the_runs(results: Path, tmp_path: Path):
    theirs = tmp_path / "theirs"
    shutil.copytree(results, theirs)
    assert "ponds" in {t.track for t in simnav.rank(theirs).tracks}
    merged = gather(tmp_path / "merged", [theirs])
    assert scenario_files.tracks(merged) == {"pond-v1": "ponds"}
    pond = tmp_path / "pond"
    pack(theirs, pond, runs={"pond-v1": 1})
    scenario_files.copy(pond, [theirs])
    assert [(r.scenario, r.seed) for r in store.load(pond)] == [("pond-v1", 0)]
    found = verify_results(pond)
    assert (found.passed, found.repeated, found.same) == (True, 1, 1)


def test_what_is_missing_is_not_refuted(results: Path, tmp_path: Path):
    theirs = tmp_path / "theirs"
    pack(results, theirs, runs={"pond-v1": 1})
    found = verify_results(theirs)
    assert (found.passed, found.refuted, found.different, found.not_repeatable) == (False, False, (), ())
    assert found.not_here == (
        "gnss-only on pond-v1, run 0: scenario pond-v1 is not in the catalogue; give its file with --scenario",
    )


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('plugins = ["evil.py"]\n', "names plug-ins; read it, and give it with --scenario"),
        ('[trajectory]\nkind = "pose_track"\nfile = "/etc/passwd"\n', "names the file '/etc/passwd'"),
        ('[vessel]\nkind = "pose_track"\nfile = "poses"\n', "names the file 'poses'"),
        ("version = ", "cannot be used"),
        ("", "holds pond-v1, not lake-v1"),
    ],
)
def test_a_file_of_others_runs_no_code(tmp_path: Path, more: str, message: str):
    place = tmp_path / scenario_files.FOLDER
    place.mkdir()
    text = POND + more if more.startswith("[") else more + POND
    (place / "lake-v1.toml").write_text(text)
    with pytest.raises(RequestError, match=message) as caught:
        scenario_files.load(tmp_path, "lake-v1")
    assert "lake-v1.toml came with the results and " in str(caught.value)


def test_links_and_large_files_are_not_read(tmp_path: Path):
    place = tmp_path / scenario_files.FOLDER
    place.mkdir()
    (tmp_path / "secret.toml").write_text(POND)
    (place / "pond-v1.toml").symlink_to(tmp_path / "secret.toml")
    (place / "lake-v1.toml").write_text(POND + "#" * (1 << 20))
    (place / "Not A Name.toml").write_text(POND)
    assert scenario_files.tracks(tmp_path) == {}
    assert scenario_files.load(tmp_path, "pond-v1") is None
