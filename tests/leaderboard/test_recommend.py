"""`simnav recommend`: what may be asked, and that command and call answer from a folder of results."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard.cli import app
from simnav.leaderboard.results import store
from simnav.leaderboard.results.result import Result, to_table, write_tables
from simnav.leaderboard.results.store import StoreError

#: Errors [m] in a scenario with GNSS and DVL whose fixes lie, and in one without a DVL that has an outage.
ERRORS = {
    "lasting-bias-v1": {"oracle": 1.0, "ekf": 8.0, "vb-akf": 2.0, "iae": 4.0, "gated-ekf": 9.0, "student-t": 12.0},
    "mems-only-v1": {"oracle": 1.0, "ekf": 8.0, "vb-akf": 12.0, "iae": 4.0, "gated-ekf": 9.0, "student-t": 12.0},
}
SHIP = ["imu", "gnss", "dvl", "gyrocompass"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of results that are made up."""
    path = store.create(tmp_path_factory.mktemp("recommend") / "results")
    rng = np.random.default_rng(0)
    made = []
    for scenario, by in ERRORS.items():
        store.select(path, {scenario: (scenario, {row: f"{scenario}-{row}" for row in by})})
        for row, error in by.items():
            for seed in range(12):
                scores = {"horizontal_rmse": error * float(np.exp(rng.normal(0.0, 0.1))), "update_median": 1e-4}
                made.append(Result(
                    scenario=scenario, seed=seed, estimator=row, parameters={}, reference=row == "oracle", status="ok",
                    reason="", scores=scores, key=f"{scenario}-{row}-{seed}", recording=scenario,
                ))  # fmt: skip
    with open(path / "compacted" / "part-1.parquet", "wb") as file:
        write_tables(file, map(to_table, made))
    return path


def test_only_the_results_of_some_scenarios_are_read(folder: Path) -> None:
    found = store.load(folder, series=False, scenarios=["mems-only-v1"])
    assert {r.scenario for r in found} == {"mems-only-v1"}
    assert len(found) == 12 * len(ERRORS["mems-only-v1"])
    with pytest.raises(StoreError):
        store.load(folder / "compacted", scenarios=["mems-only-v1"])


def test_the_call_answers_for_instruments_and_a_trouble(folder: Path) -> None:
    answer = simnav.recommend(SHIP, troubles="lying-fixes", results=folder)
    assert answer.instruments == ("dvl", "gnss_position", "gyrocompass", "imu")
    assert answer.row is not None
    assert answer.row.estimator == "vb-akf"
    assert answer.groups[0].scenarios == ("lasting-bias-v1",)
    assert answer.confidence == "in these scenarios"
    assert "take `vb-akf`" in repr(answer)


@pytest.mark.parametrize(
    "given", ["mems-only", "imu,gnss", ("imu", "gnss-position")], ids=["scenario", "text", "kinds"]
)
def test_instruments_may_be_named_in_several_ways(folder: Path, given: str | list[str]) -> None:
    answer = simnav.recommend(given, results=folder)
    assert answer.instruments == ("gnss_position", "imu")
    assert answer.troubles == ("outage",)
    assert answer.row is not None
    assert answer.row.estimator == "iae"


def test_a_log_stands_for_its_instruments(folder: Path, tmp_path: Path) -> None:
    """A scenario with a log: the instruments that it declares, whether its files are there or not."""
    text = (Path(simnav.__file__).parents[1] / "scenarios" / "car-kitti.toml").read_text(encoding="utf-8")
    mine = tmp_path / "my-log.toml"
    mine.write_text(text.replace('name = "car-kitti"', 'name = "my-log"', 1), encoding="utf-8")
    assert simnav.recommend(mine, troubles="outage", results=folder).instruments == ("gnss_position", "imu")


def test_the_command_prints_sentences_or_one_document(folder: Path) -> None:
    words = ["recommend", *SHIP, "-t", "lying-fixes", "--results", str(folder), "--milliseconds", "1"]
    said = CliRunner().invoke(app, words)
    assert said.exit_code == 0, said.output
    first = said.stdout.splitlines()[0]
    assert first == simnav.recommend(SHIP, troubles="lying-fixes", milliseconds=1.0, results=folder).headline()
    document = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)
    assert document["row"]["estimator"] == "vb-akf"
    assert document["sentences"][0] == first


def test_kinds_of_trouble_that_other_tracks_judge_are_named() -> None:
    """The standard result has a receiver beside an IMU in several tracks; what no track has is without evidence."""
    answer = simnav.recommend(["imu", "gnss"])
    assert answer.troubles == ("outage",)
    assert set(answer.on_other_tracks) >= {"nothing", "noisy-fixes", "imu"}
    assert not set(answer.on_other_tracks) & set(answer.without_evidence)
    assert any("`noisy-fixes`" in said for said in answer.sentences)
    assert simnav.recommend(["imu", "gnss"], troubles="imu").on_other_tracks == ()


def test_the_sentences_say_what_was_understood_and_that_a_covariance_is_too_small() -> None:
    said = simnav.recommend(["imu", "gps"], troubles="imu").sentences
    assert any(s.startswith("For gnss_position and imu the evidence is 1 scenario") for s in said)
    assert any(s.startswith("Do not trust its covariance") for s in said)


def test_a_plain_row_that_takes_too_long_is_named() -> None:
    answer = simnav.recommend(SHIP, troubles="outage", milliseconds=0.05)
    assert answer.row is not None
    assert answer.row.estimator == "ship-ekf"
    said = answer.sentences
    assert any(s.startswith("`ekf` takes") and s.endswith("more than the 0.05 ms that you allow.") for s in said)
    assert any(s.startswith("Of its ") for s in said)


def test_without_evidence_nothing_is_read(folder: Path) -> None:
    answer = simnav.recommend(["depth"], results=folder / "nowhere")
    assert answer.row is None
    assert answer.headline() == "No evidence: no scenario of the results has these troubles and instruments."


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"instruments": ["imu", "gnsss"]}, "'gnsss' is no kind of instrument; did you mean 'gnss'?"),
        ({"instruments": ["open-sea", "imu"]}, "'open-sea' is a scenario, which has its instruments: name it alone"),
        ({"instruments": []}, "no instrument was named"),
        (
            {"instruments": "imu,gnss", "troubles": ["outages"]},
            "'outages' is no kind of trouble; did you mean 'outage'?",
        ),
        ({"instruments": "imu,gnss", "milliseconds": -1.0}, "milliseconds = -1.0"),
        ({"instruments": "no-such-scenario"}, "no-such-scenario"),
    ],
)
def test_mistakes_get_one_sentence(arguments: dict[str, object], says: str) -> None:
    with pytest.raises(simnav.RequestError) as caught:
        simnav.recommend(**arguments)  # type: ignore[arg-type]
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
