"""What an estimator prints does not bury a report."""

from __future__ import annotations

import pytest

from simnav.leaderboard.estimator_output import LINES, first_lines


def lines(count: int, more: str = "") -> None:
    """Print numbers; then, on demand, fail."""
    with first_lines("mine"):
        for k in range(count):
            print(k)
        if more:
            raise OSError(more)


def test_a_few_lines_are_shown_as_they_are(capsys) -> None:
    with first_lines("mine"):
        print("one", "two", end="")
        print(" three\nfour")
    assert capsys.readouterr().out == "one two three\nfour\n"


def test_of_many_lines_the_first_are_shown_and_all_are_counted(capsys) -> None:
    with pytest.warns(UserWarning, match=f"mine printed 1000 lines; the first {LINES} are shown"):
        lines(1000)
    assert capsys.readouterr().out.splitlines() == [str(k) for k in range(LINES)]
    lines(LINES)  # no warning


def test_an_error_is_passed_on() -> None:
    with pytest.warns(UserWarning, match="printed 21 lines"), pytest.raises(OSError, match="its own"):
        lines(LINES + 1, "its own")
