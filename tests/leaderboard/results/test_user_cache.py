"""What is kept in the user's cache costs time if it is not there, and never a wrong answer."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from simnav.leaderboard.campaign import sources
from simnav.leaderboard.papers import page
from simnav.leaderboard.results.user_cache import keep, user_cache


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for made in (sources._known, sources._known_file, sources._code_of, page._state):
        made.cache_clear()
    return tmp_path / "cache" / "simnav"


def test_it_is_written_whole_or_not_at_all(cache: Path) -> None:
    keep(user_cache() / "a" / "b.txt", "text")
    assert [p.name for p in (cache / "a").iterdir()] == ["b.txt"]
    assert (cache / "a" / "b.txt").read_text() == "text"
    keep(cache / "a" / "b.txt" / "c", "below a file")  # is no error
    assert (cache / "a" / "b.txt").read_text() == "text"


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"a": 1}', '{"a": "short"}'])
def test_digests_of_code_are_the_same_with_and_without(cache: Path, damage: str) -> None:
    folder = sources.LIBRARY / "scoring"
    first = sources.folder_code(folder)
    (kept,) = cache.glob("code-*.json")
    assert len(json.loads(kept.read_text())) >= len(list(folder.glob("*.py")))
    sources._known.cache_clear()
    sources._code_of.cache_clear()
    if damage:
        kept.write_text(damage)
    assert sources.folder_code(folder) == first


def test_the_code_of_a_file_is_known_by_its_bytes(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = tmp_path / "library"
    library.mkdir()
    monkeypatch.setattr(sources, "LIBRARY", library)
    file = library / "solver.py"
    found = []
    for text in ("x = 1\n", "x = 2\n", "x = 1  # one\n", "x = 1\n"):
        file.write_text(text)
        sources._code_of.cache_clear()
        found.append(sources.folder_code(library))
        file.unlink()
    assert found[0] == found[2] == found[3] != found[1]


def test_the_page_of_a_paper_is_drawn_once(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = (page._stored(cache, "guo-2026").document, {"one.png": b"picture"})
    monkeypatch.setattr(page, "_draw", lambda key: drawn)
    assert page._drawn("guo-2026") == drawn
    monkeypatch.setattr(page, "_draw", lambda key: pytest.fail("it is drawn again"))
    assert page._drawn("guo-2026") == drawn
    (kept,) = (cache / "papers").iterdir()
    monkeypatch.setattr(page, "_draw", lambda key: drawn)
    kept.write_bytes(kept.read_bytes()[:100])
    assert page._drawn("guo-2026") == drawn
    assert kept.stat().st_size > 100
