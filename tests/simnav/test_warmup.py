"""Warm-up: finds every kernel, compiles it once, harms nobody."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from simnav import compiled, warmup

PACKAGE = {
    "simnav_plugin/__init__.py": "import simnav_plugin.kernels\n",
    "simnav_plugin/kernels.py": """
from simnav.compiled import kernel

@kernel()
def inner(x):
    return x + 1.0

@kernel("f8(f8)")
def outer(x):
    return 2.0 * inner(x)
""",
    "broken_plugin.py": "raise RuntimeError('never works')\n",
    "plugins-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: plugins\nVersion: 1.0\n",
    "plugins-1.0.dist-info/entry_points.txt": "[simnav.estimators]\na = simnav_plugin\nb = broken_plugin\n",
}

RUN = """
import sys, warnings
from simnav import compiled, warmup
reported = []
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    # Only the plug-in's kernels: those of the project are other tests' business.
    ours = lambda: [k for k in compiled._kernels if "plugin" in k.__module__ and k.signature]
    warmup.kernels = ours
    warmup.warmup(lambda *p: reported.append(p))
assert sum("broken_plugin" in str(w.message) for w in caught) == 1, caught
modules = {k.__module__ for k in compiled._kernels}
print(reported, sorted(modules & {"simnav.strapdown", "simnav.world.motion", "simnav_plugin.kernels"}))
assert "matplotlib" not in sys.modules and "gtsam" not in sys.modules
"""


def test_plug_ins_are_warm_too_and_a_broken_one_is_named(tmp_path: Path) -> None:
    for name, text in PACKAGE.items():
        path = tmp_path / "site" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
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


SEVERAL = "\n".join(f"@kernel('f8(f8)')\ndef k{i}(x):\n    return x + {i}.0\n" for i in range(5))


@pytest.mark.parametrize("processes", [1, 2])
def test_several_are_compiled_beside_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, processes: int
) -> None:
    """In other processes, which leave them in the cache; each is reported once, and all are loaded here."""
    source = tmp_path / "several.py"
    source.write_text("from simnav.compiled import kernel\n" + SEVERAL)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delitem(sys.modules, "several", raising=False)
    before = list(compiled._kernels)
    try:
        import several  # type: ignore[import-not-found]

        ours = [k for k in compiled._kernels if k not in before]
    finally:
        compiled._kernels[:] = before
        monkeypatch.delitem(sys.modules, "several", raising=False)
    monkeypatch.setattr(warmup, "kernels", lambda: ours)
    here: list[str] = []
    original = compiled.Kernel._jit

    def jit(self: compiled.Kernel, directory: str | None) -> object:
        here.append(self.__name__ if not self.cached() else "cached")
        return original(self, directory)

    monkeypatch.setattr(compiled.Kernel, "_jit", jit)
    reported: list[tuple[int, int, str]] = []
    warmup.warmup(lambda *p: reported.append(p), processes=processes)
    assert [t[0] for t in reported] == [0, 1, 2, 3, 4, 5]
    assert {t[2] for t in reported[1:]} == {f"several.k{i}" for i in range(5)}
    assert here.count("cached") == (5 if processes == 2 else 0)
    assert [k(1.0) for k in ours] == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert several.k4(0.5) == 4.5
