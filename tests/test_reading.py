"""What has to be read for a change: the files and lines that CONTRIBUTING promises."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def rows() -> list[tuple[str, int]]:
    """What has to be read for a change, and the number of lines, of the rows of the table that name lines."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = text[text.index("## What has to be read") :].partition("\n\n[A filter")[0]
    cells = ([cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines())
    return [(row[1], int(row[2])) for row in cells if len(row) == 3 and row[2].isdigit()]


def lines_of(what: str) -> int:
    """Lines of the files in a cell of the table, and of the example of an adaptation on the page that it links."""
    read = [(ROOT / file).read_text(encoding="utf-8") for file in re.findall(r"`(estimators/[^`]+)`", what)]
    for page in re.findall(r"\((docs/[^)]+)\)", what):
        blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
        read += [block for block in blocks if "(NoiseAdaptation):" in block]
    return sum(len(text.splitlines()) for text in read)


def test_a_change_needs_as_many_lines_as_promised() -> None:
    promised = rows()
    assert len(promised) == 5
    for what, lines in promised:
        assert 0.85 * lines < lines_of(what) <= lines, what
