"""``python -m simnav.leaderboard.cli``: the same as the command ``simnav``."""

from __future__ import annotations

from .application import main

if __name__ == "__main__":
    main()
