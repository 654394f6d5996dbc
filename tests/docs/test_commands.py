"""The command lines of the README and the documentation are such that the command takes them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from simnav.leaderboard.cli.application import app
from simnav.leaderboard.cli.commands import MOVED

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
#: Words that stand for a number, as in ``simnav run SCENARIO --seed SEED``.
NUMBERS = re.compile(r"\b(SEED|N)\b")


def lines_of(page: str) -> Iterator[str]:
    """Command lines in blocks of code, and those with options in the text, without the word simnav."""
    for block in re.findall(r"^ *```[a-z]*\n(.*?)^ *```", page, re.DOTALL | re.MULTILINE):
        yield from re.findall(r"^ *(?:\$ )?(?:[A-Z_]+=\S+ )*simnav (.+)$", block.replace("\\\n", " "), re.MULTILINE)
    yield from re.findall(r"`(?:[A-Z_]+=\S+ )*simnav ([^`\n]* -[^`\n]*)`", page)


def mistake(line: str) -> str | None:
    """What is wrong with a command line, in the words of the parser; None if nothing is."""
    words = shlex.split(NUMBERS.sub("3", line), comments=True)
    command: Any = get_command(app)
    while words and words[0].startswith("--") and words[0] != "--help":  # options before the command
        words = words[2:]
    while hasattr(command, "commands") and words and words[0] in command.commands:
        command = command.commands[words.pop(0)]
    try:
        command.make_context("simnav", words)
    except Exception as error:
        if not hasattr(error, "format_message"):
            return None if type(error).__name__ == "Exit" else repr(error)  # --help and --version end it
        return str(error.format_message())
    left = words[0] if hasattr(command, "commands") and words else "--help"
    return None if left == "COMMAND" or left.startswith("-") else f"no command {left!r}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_command_lines_are_understood(page: Path):
    wrong = {line: said for line in lines_of(page.read_text(encoding="utf-8")) if (said := mistake(line))}
    assert wrong == {}


@pytest.mark.parametrize("folder", ["docs", "estimators", "leaderboard", "scenarios", "simnav"])
def test_no_text_names_a_command_by_its_old_name(folder: str):
    """Also where no option follows, and in docstrings and messages, which put a command in quotes or code marks."""
    old = re.compile(rf"[`']simnav(?: --\S+ \S+)? ({'|'.join(MOVED)})\b")
    files = [p for end in ("md", "py", "toml", "html", "jinja") for p in (ROOT / folder).rglob(f"*.{end}")]
    texts = {p.relative_to(ROOT).as_posix(): p.read_text(encoding="utf-8") for p in files}
    assert len(texts) > 10
    assert {name: found for name, text in texts.items() if (found := old.findall(text))} == {}
    assert old.findall("`simnav merge` and 'simnav --plugin a.py verify x'") == ["merge", "verify"]


def test_a_wrong_line_would_be_found():
    page = "```\nA=b simnav run ekf --scenario s.toml  # so\n```\nSee `simnav list estimators --jason`."
    assert [mistake(line) is None for line in lines_of(page)] == [False, False]
    assert mistake("run open-sea -e ekf --seed N  # a run") is None
    assert mistake("campaign -s open-sea -o out") is None
    assert mistake("merge a b -o c") == "no command 'merge'"
