"""How many seeds were asked for is kept with the results, and a board says where a campaign was stopped."""

from __future__ import annotations

from pathlib import Path

import pytest

import simnav
from simnav.leaderboard.results import requested


@pytest.fixture(autouse=True)
def _unconfined(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SIMNAV_CONFINEMENT", "none")


def campaign(folder: Path, runs: int, **options: object):
    return simnav.campaign("clean-voyages", "gnss-only", runs=runs, output=folder, workers=1, oracle=False, **options)


def test_a_campaign_that_is_stopped_or_made_longer_says_so(tmp_path: Path):
    campaign(tmp_path / "out", 1)
    assert requested.read(tmp_path / "out") == {"clean-voyages-v1": (1,)}
    assert not any("raised" in text for text in simnav.rank(tmp_path / "out").tracks[0].remarks)
    stopped = campaign(tmp_path / "out", 3, minutes=0.0).ranking.tracks[0]
    assert "Stopped early: 1 of 3 seeds that were asked for count on 1 of 1 scenarios." in stopped.remarks
    campaign(tmp_path / "out", 3)
    (remark,) = (text for text in simnav.rank(tmp_path / "out").tracks[0].remarks if "raised" in text)
    assert remark == "The number of seeds was raised after results were there (1, 3) on 1 of 1 scenarios."
    merged = simnav.merge([tmp_path / "out"], tmp_path / "all")
    assert merged
    assert requested.read(tmp_path / "all") == {"clean-voyages-v1": (1, 3)}


def test_a_folder_without_or_with_a_damaged_record_says_nothing(tmp_path: Path):
    assert requested.read(tmp_path) == {}
    (tmp_path / requested.FILE).write_text("[1, 2")
    assert requested.read(tmp_path) == {}
