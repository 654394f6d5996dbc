"""No number changes unnoticed: rows, recordings and scores are what is stored, or their version was raised."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable
from functools import cache
from inspect import cleandoc
from pathlib import Path
from typing import Any

import pytest

from simnav.estimator import find, names
from simnav.kinds import KINDS
from simnav.scenario import Scenario, load
from simnav.scenario import names as scenario_names
from simnav.sensors.faults import FAULTS
from simnav.simulation import version
from tests.golden.cases import CASES
from tests.golden.fingerprints import RECORD, in_case, in_scenarios, of_case, of_scenario, own, read, said, versions

_SIMPLE = "imu disturbed"


@cache
def stored() -> dict[str, Any]:
    return read()


@cache
def case(name: str) -> dict[str, Any]:
    return of_case(CASES[name])


def kinds_of(scenarios: Iterable[Scenario]) -> set[str]:
    """The kinds of all instruments."""
    found = {getattr(spec, "kind", "imu") for scenario in scenarios for spec in scenario.instruments.values()}
    return found & set(KINDS)


@pytest.mark.parametrize("name", CASES)
def test_every_row_gives_the_numbers_of_its_version(name: str) -> None:
    asked = in_case(stored(), name, case(name), versions())
    assert not asked, f"\n{asked}"


@pytest.mark.filterwarnings("ignore::simnav.log.LogWarning")
def test_every_scenario_gives_the_recording_of_its_version() -> None:
    found = {load(name).id: entry for name in scenario_names() if (entry := of_scenario(name)) is not None}
    asked = in_scenarios(stored(), found, versions())
    assert not asked, f"\n{asked}"
    assert len(found) > 40


def test_the_cases_have_every_kind_of_fault_and_instrument_and_run_every_row() -> None:
    faults = {fault["kind"] for one in CASES.values() for fault in one.faults}
    ours = {kind for kind, cls in FAULTS.items().items() if cls.__module__.startswith("simnav.")}
    assert faults == ours
    assert kinds_of(one.scenario() for one in CASES.values()) >= kinds_of(map(load, scenario_names()))
    ran = {row for entry in stored()["cases"].values() for row, numbers in entry["rows"].items() if numbers[0] == "ok"}
    assert ran == set(filter(own, names()))
    assert stored()["versions"]["rows"].keys() == ran


def test_a_version_has_its_history() -> None:
    for name in filter(own, names()):
        cls = find(name)
        lines = re.findall(
            r"^ {0,4}(\d+)$", cleandoc(cls.__doc__ or "").partition("Versions\n--------")[2], re.MULTILINE
        )
        assert [int(n) for n in lines] == list(range(2, cls.version + 1)) or cls.version == 1, (
            f"{name} has version {cls.version}: the section Versions of its docstring says what each version changed"
        )
    lines = re.findall(r"^(\d+)$", version.__doc__ or "", re.MULTILINE)
    assert [int(n) for n in lines] == list(range(1, version.SIMULATOR_VERSION + 1))


# --- the guard itself ---------------------------------------------------------------------------------


@pytest.fixture
def before() -> dict[str, Any]:
    return copy.deepcopy(stored())


def changed(found: dict[str, Any], row: str, factor: float) -> dict[str, Any]:
    found = copy.deepcopy(found)
    found["rows"][row][3] *= factor
    return found


def test_a_changed_number_names_the_row_and_asks_for_a_version(before: dict[str, Any]) -> None:
    found, now = case(_SIMPLE), versions()
    assert not in_case(before, _SIMPLE, changed(found, "ekf", 1.0 + 1e-8), now)  # rounding
    asked = in_case(before, _SIMPLE, changed(found, "ekf", 1.0 + 1e-5), now)
    assert len(asked.versions) == 1
    assert asked.versions[0].startswith(
        f"ekf has other numbers in the case '{_SIMPLE}': undo the change, or raise `ver"
    )
    assert RECORD in asked.versions[0]
    raised = now | {"rows": now["rows"] | {"ekf": now["rows"]["ekf"] + 1}}
    asked = in_case(before, _SIMPLE, changed(found, "ekf", 1.0 + 1e-5), raised)
    assert (asked.versions, asked.outdated) == ((), ("ekf",))
    assert not in_case(before, _SIMPLE, found, raised)  # raised, although no number has changed


def test_a_changed_recording_asks_for_a_version_of_the_simulator_and_accuses_no_row(before: dict[str, Any]) -> None:
    found, now = changed(case(_SIMPLE), "ekf", 2.0), versions()
    found["recording"]["imu"][1] += 1.0
    asked = in_case(before, _SIMPLE, found, now)
    assert len(asked.versions) == 1
    assert "raise SIMULATOR_VERSION" in asked.versions[0]
    raised = now | {"simulator": now["simulator"] + 1}
    assert in_case(before, _SIMPLE, found, raised).outdated == (f"the case '{_SIMPLE}'",)
    name, entry = next(iter(before["scenarios"].items()))
    other = copy.deepcopy(entry)
    other["recording"]["truth"][1] += 1.0
    assert "raise SIMULATOR_VERSION" in str(in_scenarios(before, {name: other}, now))
    assert not in_scenarios(before, {name: entry}, now)


def test_changed_values_of_a_file_ask_for_a_version_of_the_scenario(before: dict[str, Any]) -> None:
    name, entry = next(iter(before["scenarios"].items()))
    asked = in_scenarios(before, {name: entry | {"says": "other"}}, versions())
    assert asked.versions[0].startswith(f"{name}: the file of the scenario has other values: raise its `version`")
    later = re.sub(r"\d+$", lambda m: str(int(m[0]) + 1), name)
    assert in_scenarios(before, {later: entry}, versions()).outdated == (later,)
    table = {"title": "a", "duration_s": 10, "fault": [{"kind": "outage", "start_s": 1.0}]}
    assert said(table) == said(table | {"title": "b", "duration_s": 10.0})
    assert said(table) != said(table | {"fault": [{"kind": "outage", "start_s": 2.0}]})


def test_changed_scores_of_the_same_estimates_ask_for_a_version_of_the_benchmark(before: dict[str, Any]) -> None:
    found, now = copy.deepcopy(case(_SIMPLE)), versions()
    found["scores"]["huber-fgo"]["horizontal_rmse"] *= 1.1
    (asked,) = in_case(before, _SIMPLE, found, now).versions
    assert "other scores (horizontal_rmse)" in asked
    assert "raise BENCHMARK" in asked
    assert not in_case(before, _SIMPLE, found, now | {"benchmark": "simnav-bench 9.9"}).versions
    found = copy.deepcopy(case(_SIMPLE))
    found["scores"]["huber-fgo"]["a_new_score"] = 1.0
    assert in_case(before, _SIMPLE, found, now).outdated == ("the score a_new_score of huber-fgo",)


def test_an_empty_store_is_an_error_of_the_test(tmp_path: Path, before: dict[str, Any]) -> None:
    before["cases"].pop(_SIMPLE)
    assert str(in_case(before, _SIMPLE, case(_SIMPLE), versions())) == (
        f"the stored fingerprints lack the case '{_SIMPLE}': run '{RECORD}'"
    )
