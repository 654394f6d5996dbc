"""The truth is out of reach, and nobody harms another row: each cheat and each vandal, in a real campaign."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from simnav.leaderboard.campaign.confinement.attempt import chosen_confinement
from simnav.warmup import warmup
from tests.fuzz import fuzz_draws, fuzz_logs, fuzz_tomls
from tests.hostile.answers import fuzz_answers
from tests.hostile.attacks import ANSWERS, CHEATS, VANDALS, cheats, vandals
from tests.hostile.channels import told
from tests.hostile.meetings import seen

pytestmark = pytest.mark.skipif(os.name != "posix", reason="estimators are confined on POSIX systems only")


@pytest.fixture(scope="module", autouse=True)
def warm() -> None:
    """On a fresh machine the kernels compile here, not within an estimator's time limit."""
    warmup(load=False)


@pytest.fixture(scope="module")
def confinement() -> str:
    """The one that campaigns use here; ``python -m tests.audit security`` tries each."""
    return chosen_confinement()


def test_no_cheat_gains(tmp_path: Path) -> None:
    assert len(CHEATS) == 8
    assert cheats(tmp_path, "process", seeds=2) == []


def test_no_vandal_touches_another_row(tmp_path: Path, confinement: str) -> None:
    without = ANSWERS if confinement == "bubblewrap" else set()
    assert VANDALS.keys() > without
    harm = vandals(tmp_path, confinement, seeds=1, without=without)
    assert harm.touched == []
    assert harm.unnamed == []
    assert harm.tried >= 32 - len(without)


def test_no_row_tells_another_of_a_sealed_run(tmp_path: Path, confinement: str) -> None:
    assert told(tmp_path, confinement) == {}


def test_no_row_meets_another_that_runs_at_the_same_time(tmp_path: Path, confinement: str) -> None:
    assert seen(tmp_path, confinement) == {}


def test_no_answer_ends_a_campaign() -> None:
    """A sample; ``python -m tests.audit security`` does thousands."""
    found = fuzz_answers(120, seed=1)
    assert [what for what in found if what.startswith("raised")] == []
    assert found["ok"] > 10
    assert found["invalid-output"] > 30


def test_no_broken_file_gives_a_traceback() -> None:
    """A sample; ``python -m tests.fuzz`` does thousands."""
    found = fuzz_tomls(60, seed=1) + fuzz_draws(2000, seed=1) + fuzz_logs(60, seed=1)
    assert set(found) <= {"read", "refused"}
    assert found["refused"] > 10
