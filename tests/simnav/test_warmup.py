"""Warm-up: finds every kernel, compiles it once, harms nobody."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from simnav import compiled, warmup
from tests.cases.packages import install

FILES = {
    "simnav_plugin/__init__.py": "import simnav_plugin.kernels\n",
    "simnav_plugin/kernels.py": """
from simnav.compiled import helper, kernel

@helper
def inner(x):
    return x + 1.0

@kernel
def outer(x: float) -> float:
    return 2.0 * inner(x)
""",
    "broken_plugin.py": "raise RuntimeError('never works')\n",
}

RUN = """
import sys, warnings
from simnav import compiled, warmup
reported = []
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    # Only the plug-in's kernels: those of the project are other tests' business.
    ours = lambda: [k for k in compiled.kernels() if "plugin" in k.__module__]
    warmup.kernels = ours
    warmup.warmup(lambda *p: reported.append(p))
assert sum("broken_plugin" in str(w.message) for w in caught) == 1, caught
modules = {k.__module__ for k in compiled.kernels()}
print(reported, sorted(modules & {"simnav.strapdown", "simnav.world.motion", "simnav_plugin.kernels"}))
assert "matplotlib" not in sys.modules and "gtsam" not in sys.modules
"""


def test_plug_ins_are_warm_too_and_a_broken_one_is_named(tmp_path: Path) -> None:
    install(tmp_path / "site", "plugins", {"simnav.estimators": {"a": "simnav_plugin", "b": "broken_plugin"}}, FILES)
    environment = os.environ | {
        "PYTHONPATH": str(tmp_path / "site"),
        "SIMNAV_CACHE_DIR": str(tmp_path / "cache"),
    }
    modules = "['simnav.strapdown', 'simnav.world.motion', 'simnav_plugin.kernels']"
    for reported in (
        "[(0, 1, ''), (1, 1, 'simnav_plugin.kernels.outer')]",
        "[(1, 1, '')]",  # the second time there is nothing left to do
    ):
        done = subprocess.run([sys.executable, "-c", RUN], env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip() == f"{reported} {modules}"


# Made without the decorator: no other test of the process should come across them. The last one calls the others.
SEVERAL = "from simnav.compiled import Kernel\n" + "\n".join(
    f"def k{i}(x: float) -> float:\n    return x + {i}.0\nk{i} = Kernel(k{i}, typed=True)\n" for i in range(4)
)
SEVERAL += "def k4(x: float) -> float:\n"
SEVERAL += "    return k0(x) * k1(x) - k2(x) * k3(x) + 3.0 * x + 7.0\nk4 = Kernel(k4, typed=True)\n"


@pytest.mark.parametrize("processes", [1, 2])
def test_several_are_compiled_beside_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, processes: int
) -> None:
    """In other processes, which leave them in the cache; each is reported once, the largest after those that it calls;
    and all are loaded here.
    """
    (tmp_path / "several.py").write_text(SEVERAL)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delitem(sys.modules, "several", raising=False)
    several = importlib.import_module("several")
    monkeypatch.delitem(sys.modules, "several")
    ours: list[compiled.Kernel[[float], float]] = [getattr(several, f"k{i}") for i in range(5)]
    monkeypatch.setattr(warmup, "kernels", lambda: ours)
    here: list[str] = []
    original = compiled.Kernel.compile

    def noted(self: compiled.Kernel[[float], float]) -> Callable[..., float]:
        here.append("cached" if self.cached() else self.__name__)
        return original(self)

    monkeypatch.setattr(compiled.Kernel, "compile", noted)
    reported: list[tuple[int, int, str]] = []
    warmup.warmup(lambda *p: reported.append(p), processes=processes)
    assert [t[0] for t in reported] == [0, 1, 2, 3, 4, 5]
    assert {t[2] for t in reported[1:]} == {f"several.k{i}" for i in range(5)}
    assert reported[-1][2] == "several.k4"
    if processes == 2:
        assert set(here) == {"cached"}
    assert [k(1.0) for k in ours] == [1.0, 2.0, 3.0, 4.0, 0.0]
    assert several.k4(0.5) == 0.5


def test_a_campaign_compiles_only_what_is_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    reported: list[tuple[int, int, str]] = []
    monkeypatch.setattr(warmup, "kernels", list)
    monkeypatch.setattr(warmup, "_import_all", lambda: pytest.fail("modules were imported"))
    warmup.warmup(lambda *p: reported.append(p), everything=False)
    assert reported == [(0, 0, "")]
