"""The audit of the self-test counts lost runs, those that say so, and false alarms."""

from __future__ import annotations

from typing import Any

import pytest

from simnav.scenario import load
from tests.audit import self_test
from tests.audit.__main__ import sections
from tests.audit.self_test import CAUSES, CLEAN, Ran


def measured(**of_all: Any) -> dict[str, list[Ran]]:
    """Ten runs of each cause that are lost and say so, and ten clean ones."""
    lost = [Ran("ekf", seed, True, True)._replace(**of_all) for seed in range(10)]
    return dict.fromkeys(CAUSES, lost) | {f: [Ran("ekf", s, False, False) for s in range(10)] for f in CLEAN}


def verdicts(found: dict[str, list[Ran]]) -> list[bool]:
    return [kept for *_, kept in self_test.rows(found)][-2:]


def test_it_has_twelve_causes_and_the_audit_has_the_section() -> None:
    assert len(CAUSES) == 12
    assert sections()["self_test"].parts().keys() == {*CAUSES, *CLEAN}
    for name in ("one-beacon", "rare-fixes"):
        assert load(self_test._SCENARIOS / f"{name}.toml").name == name


def test_silence_and_false_alarms_break_the_promise() -> None:
    assert verdicts(measured()) == [True, True]
    assert verdicts(measured(says=False)) == [False, True]
    alarms = measured()
    alarms[CLEAN[0]] = [Ran("ekf", 1, False, True)] * 2
    assert verdicts(alarms) == [True, False]
    alarms[CLEAN[0]] = [Ran("ekf", 1, True, True)] * 2  # lost, and it says so: no false alarm
    assert verdicts(alarms) == [True, True]


@pytest.mark.parametrize(("inconsistent", "end", "says"), [(0.4, 0.0, True), (0.1, 0.9, True), (0.1, 0.2, False)])
def test_found_is_what_the_self_test_alone_says(inconsistent: float, end: float, says: bool) -> None:
    scores = {"inconsistent": inconsistent, "inconsistent_end": end, "beyond_sigma": 1.0}
    assert self_test.found(scores) is says
