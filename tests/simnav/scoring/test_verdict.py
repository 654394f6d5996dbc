"""The verdict on a covariance is that of the worst of four."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from simnav.recording import Recording
from simnav.scoring import score
from simnav.scoring.consistency import JUDGED
from simnav.scoring.verdict import Verdict, verdict

RUNS = 50


def of(**nees: float) -> Verdict:
    return verdict({group: np.full(RUNS, nees.get(group, 1.0)) for group in JUDGED})


@pytest.mark.parametrize(
    ("nees", "badge", "group"),
    [
        ({"vertical": 1e4}, "optimistic", "vertical"),
        ({"heading": 1e4, "vertical": 1e3}, "optimistic", "heading"),
        ({"velocity": 3.0, "horizontal": 1e-3}, "optimistic", "velocity"),  # optimistic is worse than pessimistic
        ({"horizontal": 0.1, "heading": 1.2}, "pessimistic", "horizontal"),
        ({"horizontal": 1.2, "velocity": 0.7}, "consistent", "velocity"),
        ({"heading": 0.0}, "pessimistic", "heading"),
    ],
)
def test_the_worst_is_shown(nees: dict[str, float], badge: str, group: str) -> None:
    found = of(**nees)
    assert (found.badge, found.group, found.groups, found.words) == (badge, group, JUDGED, group)
    assert found.nees == pytest.approx(nees[group])


def test_what_is_not_known_is_said() -> None:
    unknown = np.full(RUNS, np.nan)
    stored = verdict(dict.fromkeys(JUDGED, unknown) | {"horizontal": np.full(RUNS, 9.0)})
    assert (stored.badge, stored.words) == ("optimistic", "horizontal only")
    ship = verdict({group: unknown if group == "vertical" else np.ones(RUNS) for group in JUDGED})
    assert (ship.badge, ship.words) == ("consistent", "horizontal; vertical unknown")
    assert verdict({}) == verdict(dict.fromkeys(JUDGED, unknown)) == Verdict()


def test_a_height_or_a_heading_that_is_wrong_is_seen_in_each_part_of_a_run(
    make_recording: Any, make_trial: Any
) -> None:
    recording: Recording = make_recording(faulty=[(49, 5.0, 0)])
    error = np.zeros((100, 9))
    error[:49, 2], error[49:, 8] = 5.0, 0.3
    covariance = np.tile(np.diag([1.0, 1.0, 1.0, 0.01, 0.01, 0.01, 1e-4, 1e-4, 1e-4]), (100, 1, 1))
    s = score(make_trial(recording, error, covariance=covariance), recording)
    assert (s["nees_vertical_clean"], s["nees_vertical_faulty"]) == pytest.approx((25.0, 0.0))
    assert (s["nees_heading_clean"], s["nees_heading_faulty"]) == pytest.approx((0.0, 900.0), abs=1e-6)
    assert (s["nees_vertical"], s["nees_heading"]) == pytest.approx((0.49 * 25.0, 0.51 * 900.0))
    for part, group in (("_clean", "vertical"), ("_faulty", "heading")):
        assert verdict({g: np.array([s[f"nees_{g}{part}"]]) for g in JUDGED}).group == group
