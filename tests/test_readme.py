"""What the README shows works as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from simnav.estimator import make
from simnav.scenario import load
from simnav.testing.contract_check import check

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
BLOCKS = {kind: re.findall(rf"```{kind}\n(.*?)```", README, re.DOTALL) for kind in ("python", "toml")}
ESTIMATORS = [b for b in BLOCKS["python"] if "@register" in b]


pytestmark = pytest.mark.usefixtures("clean_registry")


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """The estimators of the README as files."""
    folder = tmp_path_factory.mktemp("readme")
    paths = [folder / f"shown_{i}.py" for i in range(len(ESTIMATORS))]
    for path, text in zip(paths, ESTIMATORS, strict=True):
        path.write_text(text)
    return [str(p) for p in paths]


@pytest.mark.parametrize("i", range(len(ESTIMATORS)), ids=re.findall(r'@register\("(.*?)"\)', README))
def test_estimators_pass_the_contract(shown, i):
    report = check(shown[i])
    assert len(report.findings) >= 8
    assert report.passed, report


def test_first_estimator_is_short_and_useful(shown):
    from simnav.scoring import score
    from simnav.source import record
    from simnav.trial import run_trial

    assert len(ESTIMATORS[0].splitlines()) <= 25
    recording = record(load("ship-straight"), 1)
    fixes = recording.data.aids["gnss"].sigma[0, :2]
    rmse = score(run_trial(make(shown[0]), recording), recording)["horizontal_rmse"]
    assert rmse < (fixes**2).sum() ** 0.5  # better than the fixes that it was given


def test_first_scenario_runs(tmp_path):
    from simnav.source import record

    path = tmp_path / "channel.toml"
    path.write_text(BLOCKS["toml"][0])
    recording = record(load(path), 1)
    assert set(recording.data.aids) == {"gnss", "gyrocompass", "speed_log"}
    assert recording.data.aids["gnss"].faults.any()


def test_environment_is_made():
    namespace: dict = {}
    exec(next(b for b in BLOCKS["python"] if "gymnasium.make" in b), namespace)
    assert namespace["env"].observation_space.contains(namespace["observation"])


def test_calls_from_python(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(next(b for b in BLOCKS["python"] if "simnav.evaluate" in b), {})
    assert (tmp_path / "run.png").stat().st_size > 10_000
    assert capsys.readouterr().out.strip().endswith("of 2")


def test_links_lead_somewhere():
    for document in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for target in re.findall(r"\]\((?!http)([^)#]+)", document.read_text()):
            assert (document.parent / target).exists(), f"{document.name}: {target}"
