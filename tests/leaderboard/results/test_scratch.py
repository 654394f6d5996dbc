"""Temporary folders: gone at the end, gone after a kill, and never those that are in use."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from simnav.leaderboard.results import scratch as module
from simnav.leaderboard.results.scratch import scratch

pytestmark = pytest.mark.skipif(not module.LOCKS, reason="needs locks of POSIX")

OTHER = """
import sys
from pathlib import Path
from simnav.leaderboard.results.scratch import scratch

with scratch("work", Path(sys.argv[1])) as folder:
    (folder / "deep").mkdir()
    (folder / "deep" / "file").write_text("")
    print(folder, flush=True)
    sys.stdin.read()
"""


def of_another(parent: Path) -> tuple[subprocess.Popen[str], Path]:
    """A process that holds a folder, and the folder."""
    process = subprocess.Popen(
        [sys.executable, "-c", OTHER, str(parent)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_it_is_gone_at_the_end_and_after_an_error(tmp_path: Path) -> None:
    def failing() -> None:
        with scratch("work", tmp_path) as folder:
            (folder / "file").write_text("")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        failing()
    assert not list(tmp_path.iterdir())


def test_after_a_kill_the_next_one_removes_it_and_not_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    process, folder = of_another(tmp_path)
    strangers = [tmp_path / name for name in ("mine", folder.name + "x", folder.name[:-9])]
    for stranger in strangers:
        stranger.mkdir()
    monkeypatch.setattr(module, "YOUNG", -1.0)
    with scratch("work", tmp_path):
        assert (folder / "deep" / "file").exists()  # its process lives
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    assert folder.exists()
    with scratch("other", tmp_path):
        assert folder.exists()  # that is for another purpose
    with scratch("work", tmp_path) as mine:
        assert not folder.exists()
        assert mine.exists()
    assert sorted(tmp_path.iterdir()) == sorted(strangers)


def test_a_young_one_is_left_alone(tmp_path: Path) -> None:
    process, folder = of_another(tmp_path)
    process.kill()
    process.communicate()
    with scratch("work", tmp_path):
        assert folder.exists()
