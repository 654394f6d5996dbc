"""The pages of the papers: they hold the results that come with simnav, and these are whole."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from simnav.leaderboard.papers import PAPERS, documentation, reading, stored

DOCS = Path(__file__).parents[2] / "docs"


def text(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def test_the_stored_comparison(tmp_path):
    page = "tutorials/reproduce-a-paper.md"
    (code,) = re.findall(r"^```python\n(.*?)^```", text(page), re.DOTALL | re.MULTILINE)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Sage-Husa filter 3.65")


@pytest.mark.parametrize("key", PAPERS)
def test_the_pages_of_the_papers_hold_the_stored_results(key):
    page = text(f"papers/{key}.md")
    assert documentation.replaced(page, documentation.blocks(reading.paper_of(key))) == page


def test_the_overview_of_the_papers_holds_the_stored_results():
    page = text("papers/index.md")
    assert documentation.replaced(page, {"overview": documentation.overview()}) == page


def test_stored_results_are_small_and_complete():
    """Under a megabyte in all, and a figure for every row that can have one."""
    files = list(stored.FOLDER.glob("*.parquet"))
    assert sorted(f.stem for f in files) == sorted(PAPERS)
    assert sum(f.stat().st_size for f in files) < 1_000_000
    for key in PAPERS:
        found = stored.shipped_reproduction(reading.paper_of(key))
        assert found.count("absent") == 0
        assert all(f.ours is not None for f in found.findings if f.verdict not in ("failed", "unsuitable"))


def test_the_effects_in_the_text_are_those_of_the_table():
    """The gains that the page of Guo et al. quotes stand in its generated table as well."""
    prose, rows = text("papers/guo-2026.md").split("<!-- tables: begin -->")
    prose = re.sub(r"<!-- claims: begin -->.*<!-- claims: end -->", "", prose, flags=re.DOTALL)
    quoted = re.findall(r"-?[\d.]+ % \[-?[\d.]+, -?[\d.]+\]", prose)
    assert len(quoted) == 7
    assert all(f"| {gain} |" in rows for gain in quoted)
