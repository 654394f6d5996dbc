"""The command ``simnav paper train-anfis``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from simnav.estimator import make
from simnav.estimators.adaptations.anfis_file import FEATURES, Parameters
from simnav.estimators.training import anfis_training
from simnav.leaderboard import cli
from simnav.leaderboard.cli.commands import Features
from simnav.leaderboard.figures.training import LABELS

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def _few_voyages(monkeypatch):
    few = anfis_training.scenarios()[1:2]
    monkeypatch.setattr(anfis_training, "scenarios", lambda: few)


@pytest.mark.usefixtures("_few_voyages")
def test_it_writes_a_file_that_the_rows_can_use(tmp_path: Path):
    path = tmp_path / "mine.json"
    arguments = ["paper", "train-anfis", "--features", "recent", "--seeds", "1", "--passes", "4", "--out", str(path)]
    done = CliRunner().invoke(cli.app, arguments)
    assert done.exit_code == 0, done.output
    record = Parameters.load(path).record
    assert record["command"] == "simnav paper train-anfis --features recent --seeds 1 --passes 4"
    assert record["training_seeds"] == [anfis_training.FIRST_TRAINING_SEED] * 2
    assert record["fixes"] == 1140
    for words in ("pass", "kept", "reconstruction", "none is ever scored", f"{record['validation_rmse']:.4f}"):
        assert words in done.output
    for name in ("mine-memberships.png", "mine-learning.png"):
        assert (tmp_path / name).read_bytes().startswith(PNG)
    make("anfis-fgo", features="recent", file=str(path))


@pytest.mark.usefixtures("_few_voyages")
def test_json_has_every_pass(tmp_path: Path):
    path = tmp_path / "motion.json"
    done = CliRunner().invoke(
        cli.app, ["paper", "train-anfis", "--features", "motion", "-n", "1", "--passes", "3", "-o", str(path), "--json"]
    )
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert len(document["training"]) == len(document["validation"]) == document["passes"] == 3
    assert document["file"] == str(path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "network.txt"], "network.txt: the file should end in .json"),
        (["-o", "nowhere/network.json"], "there is no folder"),
        (["--features", "tea"], "'tea' is not one of"),
        (["--seeds", "0"], "greater than or equal to"),
    ],
)
def test_mistakes(tmp_path: Path, monkeypatch, arguments: list[str], message: str):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(cli.app, ["paper", "train-anfis", *arguments])
    assert done.exit_code == 2
    assert message in " ".join(done.output.split())


def test_the_command_knows_all_features_and_inputs():
    assert [f.value for f in Features] == list(FEATURES)
    assert {name for names in FEATURES.values() for name in names} == set(LABELS)
