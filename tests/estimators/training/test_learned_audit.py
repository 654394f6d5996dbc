"""The audit of learned rows: what it makes of errors."""

from __future__ import annotations

from tests.audit import learned


def test_a_group_in_which_a_learned_row_loses_has_to_be_on_its_page():
    parts = {part: [2.0, 3.0] for part in learned.parts()}
    for group in ("Outage", "Generalisation"):
        for scenario in learned.GROUPS[group]:
            parts[f"{scenario}.net-ekf"] = [4.0, 3.0]
    parts["random-voyages.net-ekf"] = [float("inf"), float("nan")]
    found = {what: (figure, promised, kept) for what, figure, promised, kept in learned.rows(parts)}
    assert len(found) == len(learned.LEARNED) * len(learned.GROUPS)
    figure, promised, kept = found["net-ekf: Outage"]
    assert figure == "1.41 (iae 1.00, gnc-fgo 1.00, solution-separation 1.00, oracle 1.00)"
    assert (promised, kept) == ("page says so", False)
    figure, promised, kept = found["net-ekf: Generalisation"]  # which its page names
    assert figure.startswith(f"{(20.0 * 2.0**1.5) ** 0.25:.2f} (")
    assert (promised, kept) == ("page says so", True)
    assert found["net-fgo: Outage"][1:] == ("at most 1.05", True)


def test_the_groups_are_titled_as_the_kinds_of_trouble_and_scenarios_exist():
    from simnav.leaderboard.ranking.troubles import troubles
    from simnav.scenario import names

    known = {scenario for group in learned.GROUPS.values() for scenario in group}
    assert known <= set(names())
    assert {t.title for t in troubles().values()} <= set(learned.GROUPS)
