"""Each scenario that is ranked belongs to one kind of trouble, which agrees with what its file declares."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from simnav.kinds import KINDS
from simnav.leaderboard.profiles import read_profile
from simnav.leaderboard.ranking.troubles import trouble_of, troubles
from simnav.leaderboard.standard import PROFILE
from simnav.scenario.catalogue import headers

HEADERS = {h.name: h for h in headers()}
RANKED = sorted({name for part in read_profile(PROFILE).parts for name in part.scenarios})

_OF_ROLE = {"velocity": {"velocity"}, "heading": {"heading"}, "depth": {"datasheet"}}
_OF_FIXES = {
    "noise_step": {"noisy-fixes"}, "gross_error": {"noisy-fixes"}, "frozen": {"noisy-fixes"},
    "bias_step": {"noisy-fixes", "lying-fixes"}, "multipath": {"noisy-fixes", "lying-fixes"},
    "ramp": {"lying-fixes"}, "spoofing": {"lying-fixes"}, "jamming": {"outage"},
}  # fmt: skip


def role_of(name: str, kinds: Mapping[str, str]) -> str:
    return KINDS[kinds[name]].role if name in kinds else name


def of_fault(fault: Mapping[str, Any], kinds: Mapping[str, str]) -> Iterator[tuple[str, set[str]]]:
    """Each instrument of a fault, or of its choices, and the troubles that the fault may be."""
    if "choice" in fault:
        for each in fault["choice"]:
            yield from of_fault(each, kinds)
        return
    for given in fault.get("instruments", ["imu"]):
        name = given if isinstance(given, str) else given["draw"]  # families draw it, under the name of its role
        if fault["kind"] == "outage":
            yield name, {"outage"}
        elif name == "imu":
            yield name, {"imu"}
        else:
            yield name, _OF_ROLE.get(role_of(name, kinds)) or _OF_FIXES[fault["kind"]]


def declared(table: Mapping[str, Any]) -> tuple[list[tuple[str, set[str]]], set[str]]:
    """What goes wrong in a scenario file: instruments with what it may be; and what its told errors may be."""
    instruments = table["instruments"]
    kinds = {name: spec.get("kind", name) for name, spec in instruments.items()}
    wrong: list[tuple[str, set[str]]] = []
    told: set[str] = set()
    for fault in table.get("fault", []):
        wrong += of_fault(fault, kinds)
    for name, spec in instruments.items():
        sheets = [spec, *(part for part in spec.values() if isinstance(part, dict))]
        if any("times_datasheet" in sheet for sheet in sheets):
            wrong.append((name, {"imu", "datasheet"} if name == "imu" else {"datasheet"}))
        if "error" in spec:
            told |= _OF_ROLE.get(role_of(name, kinds), {"noisy-fixes", "lying-fixes"})
    if "times_told" in table.get("initial_error", {}) or "alignment" in table["tags"]:
        wrong.append(("start", {"heading"}))
    if "outage" in table["tags"] and not any("outage" in kinds for _, kinds in wrong):
        wrong.append(("instrument out of reach", {"outage"}))
    if "obstacles" in table.get("surroundings", {}):
        wrong.append(("gnss", {"lying-fixes", "outage"}))
    if "wind" in table.get("surroundings", {}):
        told.add("velocity")  # the hull drifts, and a log along the bow does not measure it
    return wrong, told


def agrees(trouble: str, wrong: list[tuple[str, set[str]]], told: set[str]) -> bool:
    """Whether a scenario may belong to a kind of trouble."""
    if trouble == "nothing":
        return not wrong
    if trouble == "several":
        return any(a != b and not x & y for a, x in wrong for b, y in wrong)
    its = {name for name, kinds in wrong if trouble in kinds}
    rest = [kinds for name, kinds in wrong if name not in its and "outage" not in kinds]
    return bool(its or trouble in told) and not rest


def test_no_scenario_has_two_kinds_of_trouble_and_all_are_in_the_catalogue() -> None:
    names = [name for t in troubles().values() for name in t.scenarios]
    assert len(names) == len(set(names))
    assert set(names) <= set(HEADERS)


@pytest.mark.parametrize("name", RANKED)
def test_every_ranked_scenario_has_a_trouble_that_its_file_declares(name: str) -> None:
    trouble = trouble_of(name)
    assert trouble, f"{name} is in no kind of trouble of leaderboard/ranking/troubles.toml"
    wrong, told = declared(tomllib.loads(HEADERS[name].path.read_text(encoding="utf-8")))
    assert agrees(trouble, wrong, told), f"{name} is in {trouble!r}, and its file declares {wrong}, and tells {told}"


def test_a_wrong_trouble_would_be_found() -> None:
    """So the rule above can fail: nothing but its own kind suits a scenario with one fault."""
    wrong, told = declared(tomllib.loads(HEADERS["gnss-spoofing"].path.read_text(encoding="utf-8")))
    assert [t for t in troubles() if agrees(t, wrong, told)] == ["lying-fixes"]
