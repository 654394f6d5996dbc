"""Digests change with all that decides a result, and with nothing else."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from simnav import estimator
from simnav.estimator import find
from simnav.leaderboard.campaign import fingerprint
from simnav.leaderboard.campaign.fingerprint import (
    digest,
    estimator_source,
    recording_digest,
    simulator_version,
    variant,
)
from simnav.scenario import Scenario, load

FILE = """
from simnav import Estimate, Estimator
{imports}

class {name}({base}):
    def reset(self, start, instruments): ...
    def update(self, measurements): return Estimate(measurements.time)
"""


def write(path: Path, name: str = "Mine", base: str = "Estimator", imports: str = "") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(FILE.format(name=name, base=base, imports=imports))
    return path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A place for estimator files; what they import from it is forgotten afterwards."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    estimator.names()  # the installed ones are known before
    monkeypatch.setattr(estimator.registry, "_classes", dict(estimator.registry._classes))
    monkeypatch.setattr(estimator.registry, "_aliases", dict(estimator.registry._aliases))
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def changed_by(path: Path, *actions: Callable[[], object]) -> list[bool]:
    """Whether each action, one after the other, changes the digest of the estimator in a file."""
    seen, answers = estimator_source(find(str(path))), []
    for action in actions:
        action()
        new = estimator_source(find(str(path)))
        answers.append(new != seen)
        seen = new
    return answers


def test_texts_keep_their_boundaries() -> None:
    assert digest("ab", "c") != digest("a", "bc")
    assert digest("a") == digest("a")


def test_a_file_and_what_it_imports_from_beside_it(folder: Path) -> None:
    mine = write(folder / "fp_mine.py", imports="import fp_helper\nfrom fp_pack import part")
    (folder / "fp_helper.py").write_text("def late():\n    import fp_deeper\n")
    (folder / "fp_deeper.py").write_text("A = 1\n")
    (folder / "fp_pack").mkdir()
    (folder / "fp_pack" / "__init__.py").write_text("")
    (folder / "fp_pack" / "part.py").write_text("B = 1\n")
    assert changed_by(
        mine,
        lambda: (folder / "fp_deeper.py").write_text("A = 2\n"),
        lambda: (folder / "fp_pack" / "part.py").write_text("B = 2\n"),
        lambda: (folder / "unrelated.py").write_text("C = 1\n"),
        lambda: write(mine, imports="import fp_helper"),
        lambda: (folder / "fp_pack" / "part.py").write_text("B = 3\n"),  # no longer imported
    ) == [True, True, False, True, False]


def test_a_base_class_in_another_file(folder: Path) -> None:
    base = write(folder / "fp_base.py", "Base")
    mine = write(folder / "fp_derived.py", base="fp_base.Base", imports="import fp_base")
    other = write(folder / "fp_alone.py", "Alone")
    assert changed_by(mine, lambda: base.write_text(base.read_text() + "\n# edited\n")) == [True]
    assert changed_by(other, lambda: base.write_text(base.read_text() + "\n# again\n")) == [False]


def test_an_installed_package_counts_as_a_whole(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An estimator of a plug-in: every file of its package, data too, but not what Python makes of them."""
    package = folder / "fp_installed"
    write(package / "filters" / "mine.py")
    for place in (package, package / "filters"):
        (place / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(folder)
    import importlib

    cls = importlib.import_module("fp_installed.filters.mine").Mine
    seen = estimator_source(cls)
    (package / "__pycache__").mkdir(exist_ok=True)
    (package / "__pycache__" / "x.pyc.123").write_text("")
    (package / ".hidden").write_text("")
    assert estimator_source(cls) == seen
    (package / "weights.bin").write_bytes(b"1")
    assert estimator_source(cls) != seen


def test_our_own_estimators_share_their_sources() -> None:
    import simnav.estimators

    assert estimator_source(find("pure-inertial")) == estimator_source(find("ekf"))
    assert Path(simnav.estimators.__file__).parent.name == "estimators"


def test_building_on_our_estimators_makes_them_count(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mine = write(folder / "fp_ours.py", imports="from simnav.estimators.rows.kalman import Ekf")
    alone = write(folder / "fp_not_ours.py", "Alone")
    before = [estimator_source(find(str(p))) for p in (mine, alone)]
    original = fingerprint._installed_digest
    monkeypatch.setattr(
        fingerprint, "_installed_digest", lambda p: original(p) + ("*" if p == "simnav.estimators" else "")
    )
    after = [estimator_source(find(str(p))) for p in (mine, alone)]
    assert [a != b for a, b in zip(before, after, strict=True)] == [True, False]


def test_recordings_depend_on_scenario_simulator_and_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sea = load("open-sea")
    version = simulator_version()
    assert recording_digest(sea, version) == recording_digest(load("open-sea"), version)
    assert recording_digest(sea, version) != recording_digest(sea, version + "x")
    longer = sea.model_copy(update={"duration": sea.duration + sea.step})
    assert recording_digest(sea, version) != recording_digest(longer, version)
    assert recording_digest(sea, version) == recording_digest(sea.model_copy(update={"title": "x"}), version)


def test_the_files_of_a_log_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded: Scenario = load("ship-nbp1406")
    assert recorded.log is not None
    monkeypatch.setenv("SIMNAV_DATA", str(tmp_path))
    absent = recording_digest(recorded, "1")
    for file in recorded.log.files.values():
        path = tmp_path / recorded.log.folder / file.path.replace("{recording}", "a")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("1")
    there = recording_digest(recorded, "1")
    path.write_text("2")
    assert len({absent, there, recording_digest(recorded, "1")}) == 3


def test_variants() -> None:
    def made(**change: object) -> str:
        values = {"recording": "r", "label": "l", "name": "n", "parameters": {"a": 1, "b": 2}, "source": "s"} | change
        return variant(**values)  # type: ignore[arg-type]

    assert made() == made(parameters={"b": 2, "a": 1})
    changes = [{"recording": "x"}, {"label": "x"}, {"name": "x"}, {"parameters": {"a": 2, "b": 2}}, {"source": "x"}]
    assert len({made(), *(made(**c) for c in changes)}) == 6
