"""A copy of simnav without symbolic links says so when it is imported."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import simnav
from simnav.checkout import LINKED, require_links

PACKAGE = Path(simnav.__file__).parent


def test_this_checkout_is_whole():
    require_links(PACKAGE)


@pytest.mark.parametrize("name", LINKED)
def test_a_link_that_became_a_text_file_is_named(tmp_path, name):
    for link in LINKED:
        (tmp_path / link).mkdir()
    (tmp_path / name).rmdir()
    (tmp_path / name).write_text(f"../{name}")
    with pytest.raises(ImportError, match=re.escape(f"{tmp_path / name} should be a symbolic link to ../{name}")):
        require_links(tmp_path)


def test_the_import_of_such_a_copy_ends_with_the_sentence(tmp_path):
    copy = tmp_path / "simnav"
    copy.mkdir()
    for item in PACKAGE.iterdir():
        if item.name in LINKED:
            (copy / item.name).write_text(f"../{item.name}")
        elif item.is_dir() and item.name != "__pycache__":
            shutil.copytree(item, copy / item.name, ignore=shutil.ignore_patterns("__pycache__"))
        elif item.is_file():
            shutil.copy(item, copy)
    done = subprocess.run(
        [sys.executable, "-c", "import simnav"], cwd=tmp_path, env={"PYTHONPATH": str(tmp_path)}, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError")
    assert "git clone -c core.symlinks=true" in last
