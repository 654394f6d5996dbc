"""What ``simnav list`` keeps of the estimators: it is what the registry says, until a file changes."""

from __future__ import annotations

from simnav.estimator import describe, names
from simnav.leaderboard.cli import own_estimators


def test_the_list_is_kept_until_a_file_changes(tmp_path, monkeypatch):
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path))
    assert not own_estimators._only_own()  # the registry is loaded: anybody may have registered something
    known = [(d.name, d.summary, d.reference) for d in map(describe, names())]
    assert own_estimators.summaries() == known
    assert not list(tmp_path.glob("estimators.json"))

    monkeypatch.setattr(own_estimators, "_only_own", lambda: True)
    assert own_estimators.summaries() == known
    state = own_estimators._state()
    monkeypatch.setattr(own_estimators, "_imported", list)
    assert own_estimators.summaries() == known

    monkeypatch.setattr(own_estimators, "_state", lambda: state + " of an edited file")
    assert own_estimators.summaries() == []


def test_a_damaged_file_is_written_again(tmp_path, monkeypatch):
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(own_estimators, "_only_own", lambda: True)
    found = [own_estimators.Summary("ekf", "a filter", False)]
    monkeypatch.setattr(own_estimators, "_imported", lambda: found)
    for text in ("", "{}", "[1]", '{"state": 1, "estimators": [[1]]}'):
        (tmp_path / "estimators.json").write_text(text)
        assert own_estimators.summaries() == found
    monkeypatch.setattr(own_estimators, "_imported", list)
    assert own_estimators.summaries() == found
