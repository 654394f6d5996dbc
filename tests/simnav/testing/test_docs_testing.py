"""The examples of docs/how-to/test-your-estimator.md work as they stand."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from simnav.testing.contract_check import CHECKS

TEXT = (Path(__file__).parents[3] / "docs" / "how-to" / "test-your-estimator.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python\n(.*?)^```", TEXT, flags=re.DOTALL | re.MULTILINE)
FILES = {m[1]: text for text in EXAMPLES if (m := re.match(r"# (\w+\.py)\n", text))}
COMMANDS = re.findall(r"^simnav (bench .*?)\s*(?:#.*)?$", TEXT, flags=re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A project with the files of the page."""
    path = tmp_path_factory.mktemp("project")
    for name, text in FILES.items():
        (path / name).write_text(text)
    return path


def test_the_test_suite_passes(folder: Path):
    assert set(FILES) == {"last_fix.py", "conftest.py", "test_contract.py", "test_accuracy.py", "test_cost.py"}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--color=no", "--benchmark-disable"],
        cwd=folder, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert f"{2 * len(CHECKS) + 2 + 3} passed" in done.stdout


def test_the_table_has_all_checks_and_their_sentences():
    rows = re.findall(r"^\| `([a-z ]+)` \| ([A-Z].*?) \|$", TEXT, flags=re.MULTILINE)
    assert rows == [(c.name, c.sentence) for c in CHECKS]


def test_the_call_from_python(folder: Path):
    (text,) = (text for text in EXAMPLES if "simnav.bench" in text)
    done = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert [line.split()[0] for line in done.stdout.splitlines()] == ["last-fix(gain=0.5)", "gnss-only", "ekf"]


@pytest.mark.parametrize("command", COMMANDS)
def test_the_commands_are_understood(folder: Path, command: str):
    words = [sys.executable, "-m", "simnav", *command.split(), "--epochs", "3", "--rounds", "1"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "last_fix" in done.stdout
    assert "unsuitable" not in done.stdout


def test_there_are_commands():
    assert len(COMMANDS) == 2
