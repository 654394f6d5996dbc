"""How the classes of others become known: registries, entry points, single files."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from simnav import plugins as module
from simnav.plugins import PluginError, Registry, code_digest, load_plugin
from simnav.scenario import load
from tests.cases.packages import install


class One:
    """A class to register."""


class Two:
    """Another one."""


@pytest.fixture
def registry() -> Registry:
    return Registry("thing", "simnav.things", "simnav.spec")


def test_classes_are_found_by_name_in_their_order(registry):
    registry.add("one", One)
    registry.add("another_one", Two)
    assert registry.get("one") is One
    assert registry.get("three") is None
    assert list(registry.items()) == ["one", "another_one"]


def test_a_name_is_taken_once_but_a_class_replaces_itself(registry):
    registry.add("one", One)
    again = type("One", (), {"__module__": One.__module__})
    registry.add("one", again)
    assert registry.get("one") is again
    with pytest.raises(PluginError, match=r"kind 'one' of thing Two: the name is taken by One \(.*, line \d+\)"):
        registry.add("one", Two)
    with pytest.raises(PluginError, match=r"'Not-Snake' of thing Two.* snake_case"):
        registry.add("Not-Snake", Two)


def test_what_fails_while_it_is_added_is_taken_back(registry):
    registry.add("one", One)
    with pytest.raises(ZeroDivisionError), registry.adding("two", Two):
        1 / (registry.get("two") is not Two)
    assert list(registry.items()) == ["one"]


class _Point:
    """A stand-in for an entry point."""

    dist = None

    def __init__(self, name, load):
        self.name, self.value, self.load = name, f"{name}_package", load


def test_a_broken_plug_in_is_named_and_harms_nobody(registry, monkeypatch):
    def broken():
        registry.add("half_done", Two)
        raise RuntimeError("no licence")

    def thief():
        registry.add("one", Two)

    registry.add("one", One)
    points = [_Point("a_thief", thief), _Point("broken", broken), _Point("good", lambda: registry.add("good", Two))]
    monkeypatch.setattr(module, "entry_points", lambda group: points if group == "simnav.things" else [])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert registry.items() == {"one": One, "good": Two}
    said = [str(w.message) for w in caught]
    assert any("thing plug-in 'broken'" in s and "RuntimeError: no licence" in s for s in said)
    assert any("'a_thief'" in s and "taken by One" in s for s in said)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = (", "bad.py, line 1: it cannot be imported: SyntaxError"),
        ("\n1 / 0\n", "bad.py, line 2: it cannot be imported: ZeroDivisionError: division by zero"),
        (
            "from simnav import Kind, register_instrument\n"
            "@register_instrument(Kind('x', 'other', ()), example={})\nclass A: pass\n",
            "a kind has one to 3 components, not 0",
        ),
    ],
)
def test_files_that_cannot_be_loaded(tmp_path, plugins, text, message):
    (tmp_path / "bad.py").write_text(text)
    with pytest.raises(PluginError) as caught:
        load_plugin(tmp_path / "bad.py")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there():
    with pytest.raises(PluginError, match=r"there is no plug-in file 'nowhere.py'"):
        load_plugin("nowhere.py")


def test_an_installed_package_is_found_by_its_entry_points(plugins, tmp_path):
    points = {"simnav.instruments": {"beacon": "beacon"}, "simnav.faults": {"echo": "echo", "broken": "nowhere"}}
    install(tmp_path, "lagoon", points, {f: (plugins / f).read_text() for f in ("beacon.py", "echo.py")})
    code = (
        "from simnav.kinds import KINDS\nfrom simnav.sensors import fault_specs\n"
        "print(list(KINDS)[-1], KINDS['beacon'].role, fault_specs()[-1].__name__)"
    )
    path = os.pathsep.join([str(tmp_path), str(Path(module.__file__).parents[1])])
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["beacon", "range", "Echo"]
    assert "fault plug-in 'broken' (nowhere) of package 'lagoon' is left out: ModuleNotFoundError" in done.stderr


def test_the_digest_of_a_file_tells_its_code_and_no_comment_docstring_or_line():
    code = '"""An instrument."""\n\ndef observe(x):\n    """What it reads."""\n    return 2.0 * x  # metres\n'
    tidied = "def observe(x):\n\n    return 2.0 * x\n"
    assert code_digest(code.encode()) == code_digest(tidied.encode())
    assert code_digest(code.encode()) != code_digest(code.replace("2.0", "2.5").encode())
    assert code_digest(b"no Python at all") != code_digest(b"no Python at  all")


def test_a_comment_in_a_plug_in_changes_no_scenario(plugins, tmp_path):
    for name in ("beacon.py", "echo.py", "lagoon.toml"):
        (tmp_path / name).write_text((plugins / name).read_text())
    beacon, hashes = tmp_path / "beacon.py", []
    for old, new in (("import numpy", "import numpy"), ("import numpy", "# arrays\nimport numpy"), ("1.0", "1.5")):
        beacon.write_text(beacon.read_text().replace(old, new, 1))
        hashes.append(load(tmp_path / "lagoon.toml").content_hash())
    assert hashes[0] == hashes[1] != hashes[2]
