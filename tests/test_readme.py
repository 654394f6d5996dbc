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

    assert len(ESTIMATORS[0].splitlines()) <= 25
    recording = record(load("ship-straight"), 1)
    fixes = recording.data.aids["gnss"].sigma[0, :2]
    rmse = score(run_trial(make(shown[0]), recording), recording)["horizontal_rmse"]
    assert rmse < (fixes**2).sum() ** 0.5  # better than the fixes that it was given


def test_links_lead_somewhere():
    for document in ROOT.glob("*.md"):  # those of docs/ are checked by the strict build of the site
        for target in re.findall(r"\]\((?!http)([^)#]+)", document.read_text()):
            assert (document.parent / target).exists(), f"{document.name}: {target}"
