"""Digests change with all that decides a result, and with nothing else."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from simnav.estimator import find
from simnav.leaderboard.campaign import sources
from simnav.leaderboard.campaign.fingerprint import (
    digest,
    estimator_source,
    has_recordings,
    named_files,
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
def folder(tmp_path: Path, clean_registry: None) -> Iterator[Path]:
    """A place for estimator files; what they import from it is forgotten afterwards."""
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


def test_what_is_imported_from_a_folder_by_a_text_or_from_elsewhere(folder: Path) -> None:
    """A folder without an __init__.py, importlib, a folder that the file adds to the path, data in a folder."""
    imports = """
import importlib, sys
from pathlib import Path
from fp_space import part
KIND = "a"
importlib.import_module("fp_by_text")
importlib.import_module(f"fp_method_{KIND}")
sys.path.insert(0, str(Path(__file__).parent.parent / "fp_lib"))
import fp_elsewhere
Path(__file__).with_name("fp_weights") / "net.json"
"""
    modules = ["mine/fp_space/part.py", "mine/fp_by_text.py", "mine/fp_method_a.py", "fp_lib/fp_elsewhere.py"]
    for name in modules:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("A = 1\n")
    weights = folder / "mine" / "fp_weights" / "net.json"
    weights.parent.mkdir()
    weights.write_text("1")
    mine = write(folder / "mine" / "fp_many.py", imports=imports)
    try:
        for name in modules:
            assert changed_by(mine, lambda name=name: (folder / name).write_text("A = 2\n")) == [True], name
            assert changed_by(mine, lambda name=name: (folder / name).write_text("A = 2  # two\n")) == [False], name
        assert changed_by(mine, lambda: weights.write_text("2")) == [True]
        assert changed_by(mine, lambda: (folder / "mine" / "other.py").write_text("A = 1\n")) == [False]
    finally:
        sys.path[:] = [p for p in sys.path if str(folder) not in p]


def test_what_an_instrument_of_others_imports(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The recordings of a scenario depend on it."""
    for name in ("beacon.py", "echo.py", "excursion.py", "lagoon.toml"):
        shutil.copy(Path(__file__).parents[2] / "simnav" / "plugins" / name, folder)
    beacon = folder / "beacon.py"
    beacon.write_text(beacon.read_text().replace("annotations\n", "annotations\nimport fp_of_beacon\n", 1))
    helper = folder / "fp_of_beacon.py"
    helper.write_text("A = 1\n")
    code = (
        "import sys, simnav\n"
        "from simnav.leaderboard.campaign.fingerprint import recording_digest\n"
        "print(recording_digest(simnav.load(sys.argv[1]), '1+0'))\n"
    )

    def found() -> str:
        command = [sys.executable, "-c", code, str(folder / "lagoon.toml")]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    before = found()
    helper.write_text("A = 1  # a comment\n")
    assert found() == before
    helper.write_text("A = 2\n")
    assert found() != before


def test_a_base_class_in_another_file(folder: Path) -> None:
    base = write(folder / "fp_base.py", "Base")
    mine = write(folder / "fp_derived.py", base="fp_base.Base", imports="import fp_base")
    other = write(folder / "fp_alone.py", "Alone")
    assert changed_by(mine, lambda: base.write_text(base.read_text() + "\nEDITED = 1\n")) == [True]
    assert changed_by(other, lambda: base.write_text(base.read_text() + "\nAGAIN = 1\n")) == [False]


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


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the library and of our estimators, whose files a test may edit."""
    copy = tmp_path / "copy" / "simnav"
    ignored = shutil.ignore_patterns("leaderboard", "scenarios", "__pycache__")
    shutil.copytree(sources.LIBRARY, copy, ignore=ignored)
    monkeypatch.setattr(sources, "LIBRARY", copy)
    return copy


def edit(path: Path, old: str, new: str) -> None:
    """Replace a text that is in a file."""
    text = path.read_text()
    assert old in text, path
    path.write_text(text.replace(old, new, 1))


def constant(path: Path) -> None:
    """Add a constant."""
    path.write_text(f"{path.read_text()}\nA = 1\n")


def comment(path: Path) -> None:
    """Add a comment, a docstring and an empty line: nothing that decides a number."""
    path.write_text(f'"""Another docstring."""\n\n# a comment\n{path.read_text()}\n"""And a last word."""\n')


def test_a_docstring_and_the_chart_keep_the_recordings_and_a_constant_changes_them(library: Path) -> None:
    versions = [simulator_version()]

    def after(action: Callable[..., None], *args: object) -> bool:
        action(*args)
        versions.append(simulator_version())
        return versions[-1] != versions[-2]

    assert not after(comment, library / "strapdown.py")
    assert not after(
        edit, library / "simulation" / "simulator.py", '"""Simulate the run up to a time.', '"""Something else.'
    )
    assert not after(constant, library / "environment" / "rendering.py")
    assert not after(edit, library / "scoring" / "outages.py", "RECOVERY_THRESHOLD = 10.0", "RECOVERY_THRESHOLD = 11.0")
    assert not after(edit, library / "trial" / "log.py", "DIVERGENCE_LIMIT = 100e3", "DIVERGENCE_LIMIT = 90e3")
    assert after(edit, library / "simulation" / "simulator.py", "_RATE_WITHOUT_IMU = 20.0", "_RATE_WITHOUT_IMU = 21.0")
    assert after(constant, library / "geometry" / "earth.py")  # imported indirectly
    assert not after(constant, library / "log" / "nmea.py")
    assert after(constant, library / "sensors" / "faults" / "additive.py")


@pytest.mark.parametrize("scenario", ["open-sea", "harbour-multipath"])
def test_what_a_recording_loads_is_in_its_digest(scenario: str) -> None:
    """Of what does not count for a recording, nothing is loaded when one is made."""
    code = f"""
import json, sys
from simnav.scenario import load
from simnav.source import record
record(load({scenario!r}), 0)
print(json.dumps([name for name in sys.modules if name.partition(".")[0] == "simnav"]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    found = {name: importlib.util.find_spec(name) for name in json.loads(done.stdout)}
    loaded = {name for name, spec in found.items() if spec is None or spec.submodule_search_locations is None}
    assert len(loaded) > 20
    never = {"leaderboard", "estimators", "estimator", "environment", "trial", "testing", "scoring"}
    assert not {name for name in loaded if name.split(".")[1] in never}


def test_an_estimator_is_known_by_all_code_of_simnav_that_can_decide_a_number(folder: Path, library: Path) -> None:
    """Whatever that is: a rerun is cheap, a stale number is not. Words, scores and what is for tests do not count."""
    mine = write(folder / "fp_ours.py", imports="from simnav.estimators.rows.federated import Federated")

    def changed(action: Callable[..., None], *args: object) -> list[bool]:
        before = [estimator_source(find(name)) for name in ("ekf", str(mine))]
        action(*args)
        return [estimator_source(find(n)) != old for n, old in zip(("ekf", str(mine)), before, strict=True)]

    row = library / "estimators" / "rows" / "kalman.py"
    data = sorted((library / "estimators").rglob("anfis_innovation.json"))
    assert changed(comment, row) == [False, False]
    assert changed(constant, row) == [True, True]
    assert changed(constant, library / "estimators" / "solvers" / "kalman.py") == [True, True]
    assert changed(edit, library / "trial" / "log.py", "DIVERGENCE_LIMIT = 100e3", "DIVERGENCE_LIMIT = 90e3") == [
        True, True,
    ]  # fmt: skip
    assert changed(edit, data[0], "{", "{ ") == [True, True]
    assert changed(constant, library / "scoring" / "accuracy.py") == [False, False]
    assert changed(constant, library / "testing" / "cost.py") == [False, False]
    assert changed(constant, mine) == [False, True]


def test_no_row_loads_what_does_not_count() -> None:
    code = """
import json, sys
from simnav.estimator import find, make, names
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial
scenario = load("harbour-multipath").model_copy(update={"duration": 3.0})
for name in names():
    run_trial(make(name), record(scenario, 0))
print(json.dumps([name for name in sys.modules if name.partition(".")[0] == "simnav"]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[1] for name in json.loads(done.stdout) if "." in name}
    assert not loaded & {"leaderboard", "scoring", "testing", "warmup"}


def test_words_keep_the_key_of_a_file_of_the_users_own(folder: Path) -> None:
    mine = write(folder / "fp_words.py", imports="GAIN = 1.0")
    assert changed_by(
        mine,
        lambda: comment(mine),
        lambda: edit(mine, "GAIN = 1.0", "GAIN = 2.0"),
    ) == [False, True]


def test_the_content_of_files_that_parameters_name_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def made(value: object) -> str:
        return variant("r", "l", "n", {"weights": value}, "s")

    monkeypatch.chdir(tmp_path)
    path = tmp_path / "weights.json"
    absent = made("weights.json")
    path.write_text("1")
    first = [made(value) for value in ("weights.json", path, [path], ("a", str(path)))]
    assert made("weights.json") == first[0] != absent
    path.write_text("2")
    assert all(made(v) != old for v, old in zip(("weights.json", path, [path], ("a", str(path))), first, strict=True))
    assert named_files(["fast", 3.0, None, str(tmp_path), "x" * 5000, "a\0b", b"weights.json"]) == []


def test_a_file_that_a_default_names_counts(folder: Path) -> None:
    (folder / "table.csv").write_text("1")
    mine = write(folder / "fp_default.py")
    edit(mine, "    def reset", f"    def __init__(self, table={str(folder / 'table.csv')!r}): ...\n    def reset")
    assert changed_by(mine, lambda: (folder / "table.csv").write_text("2")) == [True]


def test_recordings_depend_on_scenario_simulator_and_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sea = load("open-sea")
    version = simulator_version()
    assert recording_digest(sea, version) == recording_digest(load("open-sea"), version)
    assert recording_digest(sea, version) != recording_digest(sea, version + "x")
    assert recording_digest(sea, "0.1.0+abc") == recording_digest(sea, "0.2.0+abc")  # a number alone changes nothing
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


def test_what_reads_log_files_decides_recorded_scenarios_only(library: Path) -> None:
    recorded, simulated = load("ship-nbp1406"), load("open-sea")
    if not has_recordings(recorded):
        pytest.skip("its recordings are not on this machine")
    before = [recording_digest(s, simulator_version()) for s in (recorded, simulated)]
    constant(library / "log" / "nmea.py")
    after = [recording_digest(s, simulator_version()) for s in (recorded, simulated)]
    assert [a == b for a, b in zip(after, before, strict=True)] == [False, True]


def test_variants() -> None:
    def made(**change: object) -> str:
        values = {"recording": "r", "label": "l", "name": "n", "parameters": {"a": 1, "b": 2}, "source": "s"} | change
        return variant(**values)  # type: ignore[arg-type]

    assert made() == made(parameters={"b": 2, "a": 1})
    changes = [{"recording": "x"}, {"label": "x"}, {"name": "x"}, {"parameters": {"a": 2, "b": 2}}, {"source": "x"}]
    assert len({made(), *(made(**c) for c in changes)}) == 6
