"""The standard result: the results of the profile ``standard`` that come with simnav, and what is made of them.

``results/`` is a packed folder of results (`simnav.leaderboard.results.packing`), so that all commands can read it.
``history.csv`` holds each edition of the board, row by row (`simnav.leaderboard.standard.history`). Results are
addressed by declared versions (`simnav.leaderboard.results.versions`).
"""

from __future__ import annotations

from pathlib import Path

__all__ = ["HISTORY", "PROFILE", "RESULTS", "shipped"]

#: The profile that is run.
PROFILE = "standard"
#: Folder of the results that come with simnav.
RESULTS = Path(__file__).with_name("results")
#: File of all editions.
HISTORY = Path(__file__).with_name("history.csv")


def shipped(folder: Path = RESULTS) -> bool:
    """Whether there is a standard result."""
    return (folder / "simnav-results.json").is_file()
