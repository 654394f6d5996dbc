"""Citations: of this version, and of results."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import pytest

from simnav.leaderboard.results.citation import AUTHORS, TITLE, citation
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.provenance import BENCHMARK, Provenance

MADE = Provenance(benchmark=BENCHMARK, commit="0123456789abcdef", dirty=False, simnav="0.1.0", date="2026-03-05")


def test_simnav_itself():
    found = citation()
    assert found.bibtex.startswith("@software{simnav,\n")
    assert f"version = {{{version('simnav')}}}" in found.bibtex
    assert found.bibtex.count("{") == found.bibtex.count("}")
    assert BENCHMARK in found.text


def test_results_are_cited_with_the_author_who_made_them():
    assert citation([MADE], "Ana Silva").bibtex.splitlines()[1] == "  author  = {Ana Silva},"
    assert citation([MADE]).author == AUTHORS
    for wrong, said in (("a}b", "no braces"), ("two\nlines", "printable"), (" ", "printable")):
        with pytest.raises(RequestError, match=said):
            citation([MADE], wrong)
    with pytest.raises(RequestError, match="for results only"):
        citation(None, "Ana Silva")


def test_results_are_cited_with_their_commit_days_and_number():
    found = citation([MADE, MADE, replace(MADE, date="2026-03-07")])
    assert found.key == "simnav-bench-1.0"
    assert f"{BENCHMARK}; 3 runs; commit 0123456789ab; computed from 2026-03-05 to 2026-03-07" in found.bibtex
    assert found.year == "2026"
    assert "commit 0123456789ab with changes" in citation([replace(MADE, dirty=True)]).text


def test_versions_of_the_benchmark_have_no_common_citation():
    with pytest.raises(RequestError, match="must not be mixed"):
        citation([MADE, replace(MADE, benchmark="simnav-bench 0.9")])


def test_the_file_for_github_says_the_same():
    text = (Path(__file__).parents[3] / "CITATION.cff").read_text(encoding="utf-8")
    fields = dict(re.findall(r'^([a-z-]+): "?([^"\n]+)"?$', text, flags=re.MULTILINE))
    assert fields["cff-version"] == "1.2.0"
    assert fields["title"] == TITLE
    assert fields["version"] == version("simnav")
