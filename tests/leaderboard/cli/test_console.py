"""How the command talks: progress on a terminal and elsewhere."""

from __future__ import annotations

import io
import time

import pytest
from rich.console import Console
from rich.text import Text
from typer.main import get_command

from simnav.leaderboard.cli.application import app
from simnav.leaderboard.cli.console import Output, ProgressBar


def test_progress_without_a_terminal_says_how_long(capsys, monkeypatch):
    monkeypatch.setattr(ProgressBar, "PAUSE", 0.0)
    with Output().progress("running") as progress:
        progress(1, 4, left=75.0)
        progress(4, 4)
    said = capsys.readouterr()
    assert said.out == ""
    assert "running: 1/4" in said.err
    assert "1:15 left" in said.err


def wait_for(text: str, screen: io.StringIO) -> None:
    """Until the bar, which is drawn five times a second, shows a text."""
    end = time.monotonic() + 60.0
    while text not in screen.getvalue():
        assert time.monotonic() < end, screen.getvalue()
        time.sleep(0.02)


def test_progress_on_a_terminal_begins_each_stage_anew():
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=100)
    with ProgressBar(console, "starting") as progress:
        progress.begin("compiling")
        progress(7, 16, "a kernel", 30.0)
        wait_for("7/16", screen)
        assert "0:30" in screen.getvalue()
        screen.truncate(0)
        progress.begin("running")
        wait_for("running", screen)
    assert "running" in screen.getvalue()
    assert "16" not in screen.getvalue()


def commands_of(command, name: str = "simnav"):
    yield pytest.param(command, id=name)
    for below, each in getattr(command, "commands", {}).items():
        yield from commands_of(each, f"{name} {below}")


@pytest.mark.parametrize("command", list(commands_of(get_command(app))))
def test_help_is_shown_as_it_is_written(command):
    """Rich takes words in square brackets for a style and shows none of them."""
    for text in (command.help, *(getattr(p, "help", None) for p in command.params)):
        assert Text.from_markup(text or "").plain == (text or "")
