"""Whether instruments suit an estimator: what it needs, and whether it uses a position where there is one."""

from __future__ import annotations

from typing import Any

import pytest

from simnav.estimator import NeedsError, unsuitable, unused_positions
from simnav.estimator.looking_back import LookingBack
from simnav.kinds import KINDS
from simnav.types import Datasheet, Instruments
from tests.cases.given_errors import make_recording


def sheet(kind: str, **details: Any) -> Datasheet:
    return Datasheet(kind, kind, 1.0, 1.0, details=details)


POSITIONS = {
    "acoustic_range", "gnss_position", "gnss_raw", "gnss_receiver", "terrain_fix", "terrain_match", "usbl_fix",
    "vessel_range",
}  # fmt: skip


def test_fixes_and_ranges_give_a_position_and_soundings_where_there_is_a_chart() -> None:
    assert {kind for kind in KINDS if sheet(kind).gives_position} & set(KINDS) == POSITIONS
    assert sheet("altimeter", bottom="a chart").gives_position


def test_without_a_position_everything_suits() -> None:
    assert unused_positions([], Instruments([sheet("dvl"), sheet("depth")])) == ""


@pytest.mark.parametrize("observed", ["gps", 3, ["sonar"], [1]])
def test_names_of_instruments_are_asked_for(observed: Any) -> None:
    with pytest.raises(NeedsError, match=r"observes\(\) should return None or a collection of names"):
        unused_positions(observed, Instruments([sheet("gnss_position")]))


def test_needs_come_first_and_a_wrapper_observes_what_is_inside() -> None:
    class Inner:
        needs = ("dvl",)
        learned_from = ()

        def observes(self, instruments: Instruments) -> list[str]:
            return []

    fixes = make_recording().instruments
    wrapped = LookingBack(Inner(), [0.0])  # type: ignore[arg-type]
    assert unsuitable(wrapped, fixes) == "it needs dvl; there is none"
    Inner.needs = ()  # type: ignore[assignment]
    assert "gnss (gnss_position)" in unsuitable(wrapped, fixes)
