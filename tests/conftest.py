"""Shared by all tests: where the real logs are, if they are there, and a registry that is left as it was."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Generator
from pathlib import Path

import pytest
from _pytest.doctest import DoctestModule
from hypothesis import settings

from simnav.estimator import names, registry
from simnav.kinds import INSTRUMENTS
from simnav.log.reader import READERS
from simnav.plugins import Registry, is_file_module
from simnav.scoring import SCORES
from simnav.scoring import registry as scores
from simnav.sensors.faults import FAULTS
from simnav.spec import UNITS
from simnav.world import SURROUNDINGS, VESSELS

_BESIDE = Path(__file__).parents[2] / "shared" / "data"

# While tests are collected, nothing becomes garbage (`pytest_collection_finish`); later little of it is in cycles.
gc.disable()
gc.set_threshold(50_000, 20, 50)

# Logs beside the project are used without being asked for; what needs them skips, visibly, where there are none.
if "SIMNAV_DATA" not in os.environ and _BESIDE.is_dir():
    os.environ["SIMNAV_DATA"] = str(_BESIDE)

# A sandbox for each folder of results costs seconds; tests of the sandbox ask for it.
os.environ.setdefault("SIMNAV_CONFINEMENT", "process")

# Tables are compared as they are where there is no terminal; a worker of pytest-xdist is told of a narrow one.
os.environ.pop("COLUMNS", None)


# How long an example takes depends on the machine, and is nothing that a test asserts.
settings.register_profile("simnav", deadline=None)
settings.load_profile("simnav")


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path: Path) -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
    """Each worker searches for doctests only where some are: not in test modules, nor in files without a prompt."""
    found = yield
    none = file_path.name.startswith("test_") or b">>>" not in file_path.read_bytes()
    return [one for one in found if not (none and isinstance(one, DoctestModule))]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest test comes first, so that nobody waits for it at the end.

    Tests that wait for other processes come next: other workers compute meanwhile.
    """
    folders = "campaign", "hostile"
    items.sort(
        key=lambda item: 0 if item.path.name == "test_types.py" else 1 if item.path.parent.name in folders else 2
    )


def pytest_collection_finish() -> None:
    """The tests stay to the end: no collection of garbage needs to look at their many objects, now or later."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture
def clean_registry():
    """Names that a test registers, and what it does to the import path, are gone for the others of the process."""
    names()
    before, path = registry.snapshot(), list(sys.path)
    yield
    sys.path[:] = path
    registry.restore(before)


@pytest.fixture
def plugins(monkeypatch):
    """The folder of a third party's plug-in files; what a test loads from it is forgotten afterwards."""
    classes = [(registry, registry.items()) for registry in (INSTRUMENTS, FAULTS, SURROUNDINGS, VESSELS, READERS)]
    units = dict(UNITS)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield Path(__file__).parent / "simnav" / "plugins"
    for registry_, before in classes:
        registry_._classes = before  # in use a kind is never forgotten, so there is no public way
    UNITS.clear()
    UNITS.update(units)
    for name in [name for name in sys.modules if is_file_module(name)]:
        del sys.modules[name]


@pytest.fixture
def forget_scores(monkeypatch):
    """Scores that a test registers are gone for the others of the process; a call forgets those so far.

    What packages register is looked for again.
    """
    before = dict(SCORES)

    def forget():
        fresh = Registry("score", "simnav.scores", "simnav.scoring.standard", term="name")
        for name, score in before.items():
            fresh.add(name, score)
        monkeypatch.setattr(scores, "_REGISTRY", fresh)  # in use a score is never forgotten, so there is no public way

    forget()
    return forget


@pytest.fixture
def windows(monkeypatch):
    """The figures that a program opens in windows, in their order; the display only seems to be there.

    A canvas counts how often it is asked to draw and to react.
    """
    from matplotlib import pyplot
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    class Canvas(FigureCanvasAgg):
        required_interactive_framework = "none that there is"
        asked = flushed = 0

        def draw_idle(self):
            self.asked += 1

        def flush_events(self):
            self.flushed += 1

    class Window(Figure):
        shown = False

        def show(self, warn=True):
            self.shown = True

    opened = []

    def figure():
        opened.append(Window())
        Canvas(opened[-1])
        return opened[-1]

    monkeypatch.setattr(pyplot, "figure", figure)
    return opened
