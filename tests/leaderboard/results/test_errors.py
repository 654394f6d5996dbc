"""What others wrote reaches a terminal as text, and as nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

import simnav
from simnav.leaderboard.results.errors import sentence
from simnav.leaderboard.results.result import Result

SHOUTING = """
from simnav import Estimator
class Shouting(Estimator):
    'Raises a text that turns a terminal red and reverses what follows.'
    def reset(self, start, instruments): raise ValueError("\\x1b[31mred \\u202ereversed, Ångström 角度")
    def update(self, measurements): ...
"""
READABLE = r"\x1b[31mred \u202ereversed, Ångström 角度"


def test_the_message_of_an_exception():
    assert sentence(ValueError("\x1b[31mred \u202ereversed,\nÅngström 角度")) == READABLE


def test_the_reason_of_a_result():
    result = Result("open-sea-v1", 0, "mine", {}, False, "error", "\x1b[31mred \u202ereversed, Ångström 角度", {})
    assert result.reason == READABLE


@pytest.mark.usefixtures("clean_registry")
def test_the_reason_of_a_run(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    (tmp_path / "shouting.py").write_text(SHOUTING)
    (run,) = simnav.run("ship-straight", tmp_path / "shouting.py", seed=0).estimators
    assert run.status == "error"
    assert READABLE in run.reason
    assert "\x1b[31mred" not in "".join(capfd.readouterr())
