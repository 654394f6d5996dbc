"""What the README shows works as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from simnav.estimator import make
from simnav.scenario import load
from simnav.testing.contract_check import check
from tests.cases.closed_form import make_recording, run

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
ESTIMATORS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


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

    lines = [line for line in ESTIMATORS[0].splitlines() if line.strip()]
    assert len(lines) <= 25
    assert len([line for line in lines if not line.startswith(("import", "from"))]) <= 22
    recording = record(load("ship-straight"), 1)
    fixes = recording.data.aids["gnss"].sigma[0, :2]
    rmse = score(run_trial(make(shown[0]), recording), recording)["horizontal_rmse"]
    assert rmse < (fixes**2).sum() ** 0.5  # better than the fixes that it was given


def test_first_estimator_reduces_the_error_of_the_fixes(shown):
    """On a straight track, to 0.6 of the sigma of a fix (1.5 m)."""
    recording = make_recording(1, 300.0, turning=0.0, sea=0.0)
    errors, _ = run(make(shown[0]), recording)
    lever = np.array([2.0, -1.0, -8.0])  # not corrected for
    yaw = recording.data.truth.attitude[0, 2]
    ned = np.array([np.cos(yaw) * lever[0] - np.sin(yaw) * lever[1], np.sin(yaw) * lever[0] + np.cos(yaw) * lever[1]])
    assert np.sqrt(np.mean((errors[50:, :2] - ned) ** 2)) < 0.6 * 1.5


def test_links_lead_somewhere():
    for document in ROOT.glob("*.md"):  # those of docs/ are checked by the strict build of the site
        for target in re.findall(r"\]\((?!http)([^)#]+)", document.read_text()):
            assert (document.parent / target).exists(), f"{document.name}: {target}"
