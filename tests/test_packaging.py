"""One import name: what an installation adds, and that a user's own folders are not in its way."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Names of the files in the wheel, built from a copy of the tree."""
    folder = tmp_path_factory.mktemp("wheel")
    tree = folder / "tree"
    tree.mkdir()
    for name in ("simnav", "estimators", "scenarios", "leaderboard"):
        ignore = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, tree / name, symlinks=True, ignore=ignore)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tree)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", str(tree)]
    done = subprocess.run([*command, "--wheel-dir", str(folder)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (file,) = folder.glob("*.whl")
    return zipfile.ZipFile(file).namelist()


def test_the_only_package_that_is_installed_is_simnav(wheel: list[str]) -> None:
    top = {name.partition("/")[0] for name in wheel}
    assert {name for name in top if not name.endswith(".dist-info")} == {"simnav"}


def test_the_wheel_holds_every_source_and_data_file(wheel: list[str]) -> None:
    wanted = set()
    for place in ("simnav", "estimators", "scenarios", "leaderboard"):
        prefix = "" if place == "simnav" else "simnav/"
        for path in (ROOT / place).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                wanted.add(prefix + path.relative_to(ROOT).as_posix())
    assert wanted - set(wheel) == set()


@pytest.mark.parametrize("name", ["estimators", "scenarios", "leaderboard"])
def test_a_folder_of_the_users_own_with_one_of_our_names(tmp_path: Path, name: str) -> None:
    """Neither package hides the other: in a script beside it, and on the command line."""
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text("MINE = True\n")
    code = (
        f"import {name}, simnav.{name}\n"
        f"assert {name}.MINE and not hasattr(simnav.{name}, 'MINE')\n"
        "from simnav.scenario.catalogue import headers\n"
        "from simnav.estimator import names\n"
        "assert 'ekf' in names() and 'open-sea-v1' in {h.id for h in headers()}\n"
        "from simnav.leaderboard.cli import main\n"
    )
    (tmp_path / "script.py").write_text(code)
    for command in (["script.py"], ["-m", "simnav.leaderboard.cli", "list", "estimators"]):
        done = subprocess.run([sys.executable, "-W", "error", *command], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
