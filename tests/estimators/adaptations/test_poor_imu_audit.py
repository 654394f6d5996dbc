"""The section ``poor_imu`` of the audit: what is kept, what is not, and what a page says."""

from __future__ import annotations

import pytest

from tests.audit import poor_imu

GOOD = (1.0, 1.0, False)


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """One row whose page says when not to use it, and one whose page does not."""
    monkeypatch.setattr(poor_imu, "PLAIN", {"said": "ekf", "unsaid": "ekf"})
    monkeypatch.setattr(poor_imu, "explained", lambda name: name == "said")


def judged(ratio: float, nees: float = 1.0, row: str = "unsaid", told: bool = False) -> dict[str, tuple[str, bool]]:
    """The lines on a row that has this ratio on one voyage of 100, with their figure and whether it is kept."""
    found = {}
    for first in range(poor_imu.FIRST, poor_imu.FIRST + 100, 10):
        mine = [GOOD] * 10
        if first == poor_imu.FIRST + 30:
            mine[4] = (ratio, nees, told)
        found[f"filters-{first}"] = {"ekf": [GOOD] * 10, row: mine}
    return {what.split(":")[1].split(",")[0].strip(): (figure, kept) for what, figure, _, kept in poor_imu.rows(found)}


@pytest.mark.usefixtures("pages")
def test_one_voyage_of_a_hundred_may_be_worse_and_none_ruined():
    (figure, kept), *others = judged(3.0).values()
    assert kept
    assert not others
    assert figure.startswith(f"1.0 %; 3.0 ({poor_imu.FIRST + 34})")
    ((_, kept),) = judged(6.0).values()
    assert not kept
    ((_, kept),) = judged(6.0, row="said").values()
    assert kept


@pytest.mark.usefixtures("pages")
def test_a_page_does_not_replace_a_covariance_or_a_self_test_that_admits_the_error():
    lines = judged(20.0, nees=300.0, row="said")
    assert lines["above 1.5 times ekf"][1]
    assert lines["admitted"] == ("0 %", False)
    assert judged(20.0, nees=3.0, row="said")["admitted"] == ("100 %", True)
    assert judged(20.0, nees=300.0, row="said", told=True)["admitted"] == ("100 %", True)


@pytest.mark.usefixtures("pages")
def test_voyages_on_which_the_plain_row_is_lost_are_also_left_out():
    found = {
        f"filters-{poor_imu.FIRST}": {
            "ekf": [(1.0, 90.0, False)] * 9 + [GOOD],
            "unsaid": [GOOD] * 9 + [(2.0, 1.0, False)],
        }
    }
    everywhere, sound = list(poor_imu.rows(found))
    assert everywhere[1].startswith("10.0 %; 2.0")
    assert "where that is not lost, of 1;" in sound[0]
    assert sound[1].startswith(f"100.0 %; 2.0 ({poor_imu.FIRST + 9}); 2.00")


@pytest.mark.usefixtures("pages")
def test_a_row_that_fails_is_ruined():
    found = {f"filters-{poor_imu.FIRST}": {"ekf": [GOOD, GOOD, None], "unsaid": [GOOD, None, GOOD]}}
    (line, *_) = list(poor_imu.rows(found))
    assert line[1].startswith(f"50.0 %; inf ({poor_imu.FIRST + 1})")
    assert not line[3]


def test_every_row_has_a_plain_row_of_its_kind():
    assert poor_imu.PLAIN["imm"] == "ekf"
    assert poor_imu.PLAIN["gnc-fgo"] == "sw-fgo"
    assert poor_imu.PLAIN["student-t-rts (smoothed)"] == "ekf-rts (smoothed)"
    assert "ship-ekf" not in poor_imu.PLAIN
    assert poor_imu.explained("imm")
    assert not poor_imu.explained("ekf")
