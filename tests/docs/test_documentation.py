"""The documentation: the site builds without warnings, and the examples of the tutorials and guides work."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from simnav.estimator import make
from simnav.geometry import earth
from simnav.scenario import load
from simnav.testing.contract_check import check

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def text(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def blocks(name: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text(name), re.DOTALL | re.MULTILINE)


def commands(name: str) -> list[str]:
    return [b.strip() for b in re.findall(r"^```\n(simnav .*?)^```", text(name), re.DOTALL | re.MULTILINE)]


def simnav(folder: Path, line: str, *more: str) -> str:
    """Run a command line of a page."""
    words = shlex.split(line, comments=True)
    assert words[0] == "simnav"
    wide = {**os.environ, "COLUMNS": "200"}
    done = subprocess.run([sys.executable, "-m", *words, *more], cwd=folder, env=wide, capture_output=True, text=True)
    assert done.returncode == 0, f"{line}\n{done.stderr}"
    return done.stdout


def test_the_contract_states_the_earth_of_the_simulator():
    page = text("reference/estimator-contract.md")
    names = ("SEMI_MAJOR_AXIS", "EQUATORIAL_GRAVITY", "SOMIGLIANA", "ROTATION_RATE", "GRAVITATIONAL_CONSTANT")
    stated = {float(x) for x in re.findall(r"\d+\.?\d*(?:e[+-]?\d+)?", page)}
    assert [name for name in names if getattr(earth, name) not in stated] == []
    assert f"1/{1.0 / earth.FLATTENING:.9f}" in page
    # the formula as it is written there, at 60 degrees and 3 km below the surface
    s2, h, f, a = 0.75, -3000.0, 1.0 / 298.257223563, 6378137.0
    surface = 9.7803253359 * (1 + 0.00193185265241 * s2) / (1 - (2 * f - f * f) * s2) ** 0.5
    m = 7.292115e-5**2 * a**2 * a * (1 - f) / 3.986004418e14
    written = surface * (1 - 2 / a * (1 + f + m - 2 * f * s2) * h + 3 * h**2 / a**2)
    assert written == pytest.approx(float(earth.gravity(math.radians(60.0), h)), rel=1e-14)


# -- the site ------------------------------------------------------------------------------------------------


def test_the_site_builds_without_warnings(tmp_path):
    """Links, anchors, references in docstrings, and the pages that are made from the code."""
    pytest.importorskip("mkdocs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    commands = (tmp_path / "reference" / "commands.html").read_text()
    for name in ("campaign", "evaluate", "campaign merge", "leaderboard", "run", "paper reproduce"):
        assert f"simnav {name}" in commands
    rows = (tmp_path / "reference" / "rows.html").read_text()
    assert "iterate_above_deg" in rows
    assert "not ranked" in rows
    assert "horizontal_rmse" in (tmp_path / "reference" / "scores.html").read_text()
    assert "multipath" in (tmp_path / "reference" / "instruments.html").read_text()
    assert "<td>Recorded voyages</td>" in (tmp_path / "reference" / "scenarios.html").read_text()
    assert (tmp_path / "tutorials" / "first-estimator.ipynb").is_file()
    assert "first-estimator.ipynb" in (tmp_path / "tutorials" / "first-estimator.html").read_text()
    assert "until_decided" in (tmp_path / "reference" / "python.html").read_text()
    index = (tmp_path / "search" / "search_index.js").read_text(encoding="utf-8")  # a page from disk searches in it
    found = json.loads(index.removeprefix("var __index = ").rstrip().removesuffix(";"))
    assert any("what-helps" in page["location"] for page in found["docs"])
    assert "importScripts" in (tmp_path / "search" / "from_disk.js").read_text(encoding="utf-8")  # the theme's worker
    home = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert home.index("search/from_disk.js") < home.index("assets/javascripts/bundle")


def test_every_page_is_in_the_navigation():
    navigation = (ROOT / "mkdocs.yml").read_text()
    for page in DOCS.rglob("*.md"):
        assert str(page.relative_to(DOCS)) in navigation, page


def test_tables_of_keys_are_those_of_the_code():
    """``python docs/keys.py`` writes them."""
    keys = runpy.run_path(str(DOCS / "keys.py"))
    for page in keys["PAGES"]:
        before = page.read_text(encoding="utf-8")
        assert keys["current"](before) == before, f"{page.name}: run 'python docs/keys.py'"
        without = re.sub(r"^\| `(version|runs)` \|.*\n", "", before, count=1, flags=re.MULTILINE)
        assert without != before
        assert re.search(r"^\| `(version|runs)` \|", keys["current"](without), re.MULTILINE)


# -- tutorials -----------------------------------------------------------------------------------------------


def test_the_first_estimator_is_that_of_the_readme():
    shown = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE)
    assert blocks("tutorials/first-estimator.md", "python")[0] == shown[0]


def notebook(name: str) -> Any:
    """The notebook of a tutorial, as the documentation has it."""
    pytest.importorskip("jupytext")
    spec = importlib.util.spec_from_file_location("notebooks", DOCS / "notebooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.notebook(text(f"tutorials/{name}.md"))


@pytest.mark.parametrize("name", sorted(p.stem for p in (DOCS / "tutorials").glob("*.md") if p.stem != "index"))
def test_every_tutorial_is_a_notebook(name):
    """All Python and all commands of the page are cells, in order, and the rest is text."""
    cells = [c.source for c in notebook(name).cells if c.cell_type == "code"]
    page = f"tutorials/{name}.md"
    shown = [line for cell in cells for line in cell.splitlines() if line.startswith("!simnav")]
    assert shown == [f"!{line}" for block in commands(page) for line in block.splitlines() if line.startswith("simnav")]
    python = [c for c in cells if not c.startswith(("!", "%%writefile"))]
    for cell in python:
        compile(cell, name, "exec")
    assert len(cells) >= len(blocks(page, "python")) + len(commands(page))


def test_the_first_estimator_as_a_notebook(tmp_path, monkeypatch):
    """All cells run in order, with fewer seeds than the page asks for."""
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("COLUMNS", "200")
    found = notebook("first-estimator")
    for cell in found.cells:
        cell.source = cell.source.replace("--runs 20", "--runs 2 --against gnss-only --workers 1")
        cell.source = cell.source.replace("runs=3", "runs=2, workers=1")
    client = nbclient.NotebookClient(found, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    _, checked, ran, evaluated, called = [
        "".join(o.get("text", "") for o in c.outputs) for c in found.cells if c.cell_type == "code"
    ]
    assert "alpha-beta passes" in checked
    assert "ship-ekf" in ran
    assert (tmp_path / "run.png").stat().st_size > 10_000
    assert "alpha-beta is" in evaluated or "alpha-beta may" in evaluated
    assert re.fullmatch(r"[12] of 2", called.strip().splitlines()[-1])


def test_a_log_becomes_a_scenario(tmp_path, monkeypatch):
    monkeypatch.delenv("SIMNAV_DATA", raising=False)
    page = "tutorials/log-to-rank.md"
    lines = commands(page)
    assert [line.split()[1] for line in lines] == ["simulate", "check", "run", "evaluate"]
    simnav(tmp_path, lines[0])
    assert blocks(page, "")[1].splitlines() == (tmp_path / "data/voyage/gnss.csv").read_text().splitlines()[:2]
    scenario, outage = blocks(page, "toml")
    (tmp_path / "voyage.toml").write_text(scenario + outage)
    assert "can be run" in simnav(tmp_path, lines[1])
    assert "ship-ekf" in simnav(tmp_path, lines[2])
    assert [f.kind for f in load(str(tmp_path / "voyage.toml")).faults] == ["outage"]


def test_a_learning_agent(tmp_path, monkeypatch, capsys):
    page, names = "tutorials/learning-agent.md", {}
    monkeypatch.chdir(tmp_path)
    for block in blocks(page, "python"):
        exec(block, names)
    assert "(4, 24) (2,)" in capsys.readouterr().out
    assert abs(names["returns"][0.0]) < 1e-6
    assert names["best"] > 0.0
    (line,) = commands(page)
    words = shlex.split(line)
    assert words[2] == "policy-ekf:file=policy.npz"
    assert make("policy-ekf", file="policy.npz").policy.trained_on["voyages"] == 4


def test_a_learned_filter(tmp_path, monkeypatch, capsys):
    """In a small form: two voyages, and few runs of a scenario."""
    pytest.importorskip("torch", reason="the extra learn is not installed")
    page, names = "tutorials/learned-filter.md", {}
    monkeypatch.chdir(tmp_path)
    gather, train = blocks(page, "python")
    exec(gather.replace("range(12)", "range(2)").replace("range(6)", "range(1)"), names)
    exec(train, names)
    assert "1553 parameters" in capsys.readouterr().out
    compare, rank = commands(page)
    assert "net-ekf(file=mine.npz)" in simnav(tmp_path, compare.replace("--runs 3", "--runs 2"))
    campaign, board = rank.splitlines()
    assert "net-ekf:file=mine.npz,net-ekf," in campaign
    small = campaign.replace("random-voyages,several-faults", "random-voyages").replace("-n 10", "-n 1")
    simnav(tmp_path, small)
    assert "Learned from 1 000 voyages at most" in simnav(tmp_path, board)


# -- guides --------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("clean_registry")
@pytest.mark.parametrize(
    ("page", "number"), [("how-to/combine-pieces.md", 0), ("how-to/combine-pieces.md", 1),
                         ("how-to/combine-pieces.md", 2), ("how-to/combine-pieces.md", 3),
                         ("how-to/combine-pieces.md", 4),
                         ("how-to/combine-pieces.md", 6),
                         ("how-to/filterpy.md", 0)],
)  # fmt: skip
def test_estimators_of_the_guides_keep_the_contract(tmp_path, page, number):
    path = tmp_path / f"example_{number}.py"
    path.write_text(blocks(page, "python")[number])
    report = check(str(path))
    assert report.passed, str(report)


def test_parameters_that_two_pieces_have_in_common():
    names = dict[str, Any]()
    exec(blocks("how-to/combine-pieces.md", "python")[5], names)
    assert (names["row"].adaptation.dof, names["row"].smoother.dof) == (8.0, 6.0)


def test_the_environment(capsys):
    exec(blocks("how-to/use-the-environment.md", "python")[0], {})
    assert "imu" in capsys.readouterr().out


def test_the_scenario_of_the_guide(tmp_path):
    from simnav.source import record

    path = tmp_path / "channel.toml"
    path.write_text(blocks("how-to/write-a-scenario.md", "toml")[0])
    recording = record(load(str(path)), 1)
    assert set(recording.data.aids) == {"gnss", "gyrocompass", "speed_log"}
    assert recording.data.aids["gnss"].faults.any()


def test_calls_from_python(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(blocks("reference/python.md", "python")[0], {})
    assert (tmp_path / "run.png").stat().st_size > 10_000
    assert capsys.readouterr().out.strip().endswith("of 2")


def test_the_data_set_of_the_guide(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = dict[str, Any]()
    for block in blocks("how-to/make-a-data-set.md", "python"):
        exec(block, names)
    said = capsys.readouterr().out
    assert said.startswith("gnss ")
    assert said.count("<Recording: training-ships-v1, seed 2199023255") == 3
    assert said.count("(32, 500, 3) (32, 11, 3, 3)") == 3
    assert len(names["Learned"].learned_from) == 2
