"""The guides to vessels, surroundings and formats hold the files that are tested."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

GUIDES = Path(__file__).parents[2] / "docs" / "how-to"


@pytest.mark.parametrize(
    ("guide", "files"),
    [
        ("add-a-vessel.md", ["poses.py", "poses.toml", "barge.py"]),
        ("add-surroundings.md", ["soundings.py", "shoal.toml"]),
        ("add-a-format.md", ["fixed_records.py", "tracks.py"]),
    ],
)
def test_the_files_on_the_page_are_those_that_are_tested(plugins, guide, files):
    blocks = re.findall(r"^```\w+\n(.*?)^```$", (GUIDES / guide).read_text(), re.MULTILINE | re.DOTALL)
    for name in files:
        assert (plugins / name).read_text() in blocks, name
