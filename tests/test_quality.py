"""Style and floors: part of the tests, so that one command checks everything."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent


@pytest.mark.parametrize(
    "command",
    [
        [sys.executable, "-m", "ruff", "check", "."],
        [sys.executable, "-m", "ruff", "format", "--check", "."],
        [str(BIN / "lint-imports")],
    ],
    ids=["lint", "format", "floors"],
)
def test_quality(command):
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_files_stay_short():
    """One concept a file: none grows past 600 lines."""
    files = [
        p for package in ("simnav", "estimators", "scenarios", "leaderboard") for p in (ROOT / package).rglob("*.py")
    ]
    long = {str(p.relative_to(ROOT)): n for p in files if (n := len(p.read_text().splitlines())) > 600}
    assert not long


def test_a_kernel_has_few_arguments():
    """What belongs together goes to a kernel as one record."""
    many = {}
    for package in ("simnav", "estimators", "leaderboard"):
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                decorators = {ast.unparse(d).partition("(")[0] for d in getattr(node, "decorator_list", ())}
                if isinstance(node, ast.FunctionDef) and decorators & {"kernel", "helper"}:
                    many[f"{path.relative_to(ROOT)}: {node.name}"] = len(node.args.args)
    assert len(many) > 100
    assert not {name: n for name, n in many.items() if n > 9}


def cycles(edges):
    """Groups of names of which each reaches every other one."""
    index = {name: i for i, name in enumerate(sorted({n for edge in edges for n in edge}))}
    rows, columns = zip(*((index[a], index[b]) for a, b in edges), strict=True)
    matrix = coo_array(([1] * len(rows), (rows, columns)), shape=(len(index), len(index)))
    count, label = connected_components(matrix, directed=True, connection="strong")
    return [[n for n, i in index.items() if label[i] == k] for k in range(count) if (label == k).sum() > 1]


def test_cycles_are_found():
    assert cycles([("a", "b"), ("b", "c"), ("c", "a"), ("c", "d")]) == [["a", "b", "c"]]


def test_no_import_cycle_between_files():
    """Imports inside functions and those for type checkers count, too."""
    import grimp

    graph = grimp.build_graph("simnav", cache_dir=None, exclude_type_checking_imports=False)
    inside = "simnav.leaderboard.running", "simnav.leaderboard.campaign.campaign"  # an import in a function
    assert inside[1] in graph.find_modules_directly_imported_by(inside[0])
    for_types = "simnav.leaderboard.papers.figures", "simnav.leaderboard.papers.findings"  # under TYPE_CHECKING
    assert for_types[1] in graph.find_modules_directly_imported_by(for_types[0])
    found = cycles([(a, b) for a in graph.modules for b in graph.find_modules_directly_imported_by(a)])
    assert found == []


@pytest.mark.parametrize("package", ["estimators", "leaderboard"])
def test_neighbours_in_a_folder_are_imported_relatively(package):
    """So a folder reads and moves as a unit, and tools resolve it where there are no symbolic links."""
    absolute = []
    for path in (ROOT / package).rglob("*.py"):
        folder = ".".join(["simnav", *path.parent.relative_to(ROOT).parts])
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and not node.level and node.module:
                own = node.module == folder or node.module.rpartition(".")[0] == folder
                absolute += [f"{path.relative_to(ROOT)}:{node.lineno}"] * own
    assert absolute == []
