"""A small log, for all tests of logs."""

from __future__ import annotations

import pytest

from tests.cases.tiny_log import TinyLog


@pytest.fixture
def tiny(tmp_path, monkeypatch) -> TinyLog:
    monkeypatch.setenv("SIMNAV_DATA", str(tmp_path))
    return TinyLog(tmp_path)
