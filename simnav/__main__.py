"""``python -m simnav``: the command."""

from __future__ import annotations

from importlib import import_module

if __name__ == "__main__":
    # By name: the command is on the third floor, and the library imports nothing that is above it.
    import_module("simnav.leaderboard.cli").main()
