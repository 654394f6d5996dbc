"""Addresses of the repository and of the documentation."""

from __future__ import annotations

import subprocess

import pytest

from simnav.leaderboard.results import web_addresses as module
from simnav.leaderboard.results.citation import citation
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.web_addresses import Home, linked_from, web_address


@pytest.mark.parametrize(
    ("remote", "address"),
    [
        ("https://example.org/ana/simnav.git\n", "https://example.org/ana/simnav"),
        ("git@example.org:ana/simnav.git", "https://example.org/ana/simnav"),
        ("ssh://git@example.org:2222/ana/simnav", "https://example.org/ana/simnav"),
        ("https://ana:secret@example.org/ana/simnav.git", "https://example.org/ana/simnav"),
        ("/home/ana/simnav", ""),
        ("../simnav", ""),
        ("file:///home/ana/simnav", ""),
        ("", ""),
    ],
)
def test_a_remote_has_a_web_address_without_secrets(remote, address):
    assert web_address(remote) == address


def test_pages_of_the_documentation_stand_beside_its_first_page():
    assert Home().page("statistics") == ""
    assert Home(documentation="https://example.org/index.md").page("reference/scores") == (
        "https://example.org/reference/scores.md"
    )
    assert Home(documentation="https://example.org/latest").page("faq") == "https://example.org/latest/faq.html"
    assert Home(documentation="index.html").page("faq") == "faq.html"


def test_a_site_links_to_documentation_that_was_built(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(module, "home", lambda: Home("https://example.org/simnav", "https://example.org/docs/"))
    assert linked_from(tmp_path / "site") == module.home()
    (tmp_path / "site-docs").mkdir()
    (tmp_path / "site-docs" / "index.html").touch()
    assert linked_from(tmp_path / "site") == Home("https://example.org/simnav", "../site-docs/index.html")
    assert linked_from(tmp_path / "site", "https://other.org").documentation == "https://other.org"
    with pytest.raises(RequestError, match="elsewhere has no index"):
        linked_from(tmp_path / "site", "elsewhere")


def test_a_citation_names_the_repository(monkeypatch):
    monkeypatch.setattr("simnav.leaderboard.results.citation.home", lambda: Home("https://example.org/simnav"))
    for found in (citation(), citation([])):
        assert "  url     = {https://example.org/simnav},\n" in found.bibtex
        assert found.text.endswith(". https://example.org/simnav")


def test_the_origin_of_a_checkout_is_found(tmp_path):
    assert module._origin(tmp_path) == ""
    for words in (["init", "-q"], ["remote", "add", "origin", "git@example.org:ana/simnav.git"]):
        subprocess.run(["git", "-C", str(tmp_path), *words], check=True)
    assert web_address(module._origin(tmp_path)) == "https://example.org/ana/simnav"
