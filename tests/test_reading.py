"""What has to be read for a change: the files and lines that CONTRIBUTING promises."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def rows() -> list[tuple[list[str], int]]:
    """Files and lines of the rows of the table that name lines."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = text[text.index("## What has to be read") :].partition("\n\n[A filter")[0]
    found = []
    for line in table.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 3 and cells[2].isdigit():
            found.append((re.findall(r"`(estimators/[^`]+)`", cells[1]), int(cells[2])))
    return found


def test_a_change_needs_no_more_lines_than_promised() -> None:
    promised = rows()
    assert len(promised) == 5
    for files, lines in promised:
        assert files
        assert sum(len((ROOT / file).read_text(encoding="utf-8").splitlines()) for file in files) <= lines
