"""Kernels: loaded late, cached, and never served stale."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import get_args, get_origin

import numpy as np
import pytest

from simnav import cache_folder, compiled, warmup
from simnav.kernel_types import Vector, hints_of
from simnav.structures import structure

HELPER = """
from simnav.compiled import helper as inlined
OFFSET = {offset}

@inlined
def helper(x):
    return {factor} * x + OFFSET
"""

CALLER = """
import numpy as np
import {package}.inner as inner
from simnav.compiled import kernel
from {package}.inner import helper

TABLE = np.array([{table}])

@kernel
def caller(x: float) -> float:
    return helper(x) + TABLE[0] + inner.OFFSET
"""

RUN = """
import sys, time
sys.path.insert(0, {folder!r})
from {package}.outer import caller
assert "numba" not in sys.modules, "importing a kernel must not import numba"
hit = caller.cached()
print(caller(1.0), hit)
loaded = any(caller.compile().stats.cache_hits.values())
assert ("numba.np.npyimpl" in sys.modules) != loaded, "only what is not in the cache needs the compiler"
"""


def write(folder: Path, package: str = "pack", factor: float = 2.0, offset: float = 0.0, table: float = 0.0) -> None:
    here = folder / package
    here.mkdir(parents=True, exist_ok=True)
    (here / "__init__.py").write_text("")
    (here / "inner.py").write_text(HELPER.format(factor=factor, offset=offset))
    (here / "outer.py").write_text(CALLER.format(package=package, table=table))


def surroundings(cache: Path, **more: str) -> dict[str, str]:
    """Variables of a process that compiles source anew: files that change within a second have one time stamp."""
    return os.environ | {"SIMNAV_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1"} | more


def run(folder: Path, cache: Path, package: str = "pack", **env: str) -> tuple[float, bool]:
    """Value of the kernel at 1, and whether it came from the cache, in a process of its own."""
    code = RUN.format(folder=str(folder), package=package)
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=surroundings(cache, **env), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    value, hit = done.stdout.split()
    return float(value), hit == "True"


def test_edits_anywhere_below_a_kernel_are_noticed(tmp_path: Path) -> None:
    """A callee in another file, a constant, a constant in an array, a constant reached through its module."""
    source, cache = tmp_path / "source", tmp_path / "cache"
    write(source)
    assert run(source, cache) == (2.0, False)
    assert run(source, cache) == (2.0, True)
    write(source, factor=3.0)
    assert run(source, cache) == (3.0, False)
    write(source, factor=3.0, offset=10.0)  # used by the helper, and again through the module
    assert run(source, cache) == (23.0, False)
    write(source, factor=3.0, offset=10.0, table=0.5)
    assert run(source, cache) == (23.5, False)
    write(source)  # and back
    assert run(source, cache)[0] == 2.0


def test_an_installed_copy_and_its_source_do_not_share_what_differs(tmp_path: Path) -> None:
    """A package copied elsewhere (as a wheel is) and then edited, with the same time stamps."""
    source, installed, cache = tmp_path / "source", tmp_path / "site-packages", tmp_path / "cache"
    write(source)
    assert run(source, cache)[0] == 2.0
    shutil.copytree(source, installed)
    assert run(installed, cache)[0] == 2.0
    stamp = (installed / "pack" / "inner.py").stat()
    write(installed, factor=5.0)  # same length, same times
    os.utime(installed / "pack" / "inner.py", ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    assert (installed / "pack" / "inner.py").stat().st_size == stamp.st_size
    assert run(installed, cache) == (5.0, False)
    assert run(source, cache)[0] == 2.0


def test_an_edit_between_import_and_compilation_does_not_poison_the_cache(tmp_path: Path) -> None:
    source, cache = tmp_path / "source", tmp_path / "cache"
    write(source, factor=2.0)
    code = RUN.format(folder=str(source), package="pack").replace("hit =", "input(); hit =")
    process = subprocess.Popen(
        [sys.executable, "-c", code.replace("assert", "print('imported', flush=True); assert")],
        env=surroundings(cache),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "imported\n"
    write(source, factor=7.0)
    out, _ = process.communicate("\n", timeout=60)
    assert out.split()[0] == "2.0"
    assert run(source, cache)[0] == 7.0


@pytest.mark.skipif(os.name == "nt", reason="needs /proc or permissions of POSIX")
def test_a_cache_that_cannot_be_written_falls_back(tmp_path: Path) -> None:
    """The chosen folder is a file: the user's cache directory is taken, and still never stale."""
    source, blocked, home = tmp_path / "source", tmp_path / "blocked", tmp_path / "xdg"
    blocked.write_text("a file, not a folder")
    write(source)
    assert run(source, blocked, XDG_CACHE_HOME=str(home)) == (2.0, False)
    assert run(source, blocked, XDG_CACHE_HOME=str(home)) == (2.0, True)
    write(source, factor=4.0)
    assert run(source, blocked, XDG_CACHE_HOME=str(home)) == (4.0, False)
    assert not list(source.rglob("*.nbi")), "nothing may be cached beside the source"


@pytest.mark.skipif(sys.platform != "linux", reason="mounts nothing elsewhere")
def test_no_place_to_write_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = tmp_path / "blocked"
    blocked.write_text("")
    monkeypatch.setattr(cache_folder.tempfile, "gettempdir", lambda: str(blocked))
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(blocked))
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    assert compiled.cache_directory() is None

    def twice(x: float) -> float:
        return 2.0 * x

    monkeypatch.setattr(compiled, "cache_directory", lambda: None)
    assert compiled.Kernel(twice, "f8(f8)", False)(4.0) == 8.0


def test_a_full_disk_does_not_stop_a_kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core import caching

    def full(*args: object, **kwargs: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)

    def thrice(x: float) -> float:
        return 3.0 * x

    assert compiled.Kernel(thrice, "f8(f8)", False)(4.0) == 12.0


def test_damaged_files_of_a_kernel_and_of_its_helper_end_no_process(tmp_path: Path) -> None:
    """A bit that is wrong in the machine code, in each file in turn."""
    source, cache = tmp_path / "source", tmp_path / "cache"
    write(source)
    assert run(source, cache) == (2.0, False)
    files = [p.relative_to(cache) for p in cache.rglob("*.nb?")]
    assert len(files) == 4  # index and code of both
    for file in files:
        content = bytearray((cache / file).read_bytes())
        content[len(content) // 2] ^= 0xFF
        (cache / file).write_bytes(content)
        for other in files:
            if other.parent != file.parent:  # a helper is read only where its caller is not in the cache
                (cache / other).unlink()
        assert run(source, cache)[0] == 2.0
        assert (cache / file).read_bytes() != content


def test_prune_keeps_what_is_in_use(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path))
    root = compiled.cache_directory()
    assert root is not None
    for name, days in (("old", 61), ("young", 59)):
        (root / name / "sub").mkdir(parents=True)
        (root / name / "sub" / "k.nbi").write_text("")
        stamp = time.time() - days * 86400
        os.utime(root / name, (stamp, stamp))
    assert compiled.prune() == 1
    assert [p.name for p in root.iterdir()] == ["young"]


@compiled.kernel
def at_module_level(x: float) -> float:
    return x + 1.0


@compiled.helper
def twice(function: Callable[[float], float], x: float) -> float:
    return function(function(x))


@compiled.kernel
def two_more(x: float) -> float:
    return float(twice(at_module_level, x))


def test_a_helper_takes_a_kernel_and_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The caller is kept, with the kernel in its fingerprint."""
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path))
    assert two_more(3.0) == twice(at_module_level, 3.0) == 5.0
    assert at_module_level in two_more.tree()
    assert two_more.cached()
    assert not twice.cached()


def test_a_kernel_in_a_closure_and_its_pickle() -> None:
    def make(inner: compiled.Kernel, scale: float) -> compiled.Kernel:
        def made(x: float) -> float:
            return float(scale * inner(x))

        return compiled.Kernel(made, typed=True)

    assert make(at_module_level, 2.0)(3.0) == 8.0
    assert make(at_module_level, 3.0)(3.0) == 12.0
    assert make(at_module_level, 2.0).fingerprint() != make(at_module_level, 3.0).fingerprint()
    assert pickle.loads(pickle.dumps(at_module_level)) is at_module_level


def test_the_first_kernel_that_the_cache_lacks_is_announced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled.Kernel, "_jit", lambda self, directory: self.function)
    monkeypatch.setattr(compiled.Kernel, "directory", lambda self: tmp_path / self.__name__)
    (tmp_path / "_doubled" / "there").mkdir(parents=True)
    (tmp_path / "_doubled" / "there" / "one.nbi").touch()
    said: list[str] = []
    with compiled.announced(lambda: said.append("compiling")):
        compiled.Kernel(_doubled, typed=True).compile()
        assert said == []
        for function in (surroundings, write):
            compiled.Kernel(function, typed=True).compile()
        assert said == ["compiling"]
    compiled.Kernel(run, typed=True).compile()
    assert said == ["compiling"]


def test_a_helper_that_python_calls_is_not_compiled_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A confined estimator could not write what is compiled at its first epoch."""
    monkeypatch.setattr(compiled.Kernel, "compile", lambda self: pytest.fail(f"{self} was compiled"))
    assert compiled.Kernel(lambda x: 2.0 * x, typed=False)(3.0) == 6.0


def test_a_kernel_is_entered_without_a_check_also_where_nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """`NUMBA_DISABLE_JIT` makes a kernel its plain function."""
    assert compiled.Kernel(_doubled, typed=True).unchecked(3.0) == 6.0
    monkeypatch.setattr(compiled.Kernel, "_jit", lambda self, directory: self.function)
    assert compiled.Kernel(_doubled, typed=True).unchecked(3.0) == 6.0


def _doubled(x: float) -> float:
    return 2.0 * x


@compiled.kernel
def sum_of_squares(values: Vector) -> float:
    total = 0.0
    for k in range(values.size):
        total += values[k] * values[k]
    return total


@compiled.kernel
def root_of_squares(values: Vector) -> float:
    if values.size == 0:
        raise ValueError("nothing")
    return float(np.sqrt(sum_of_squares(values)))


@compiled.kernel
def twice_the_root(values: Vector) -> float:
    return 2.0 * root_of_squares(values)


def test_a_kernel_calls_another_one_and_has_no_copy_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine code of the caller names the other one; both have the same result if loaded, and raise its error."""
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path))
    values = np.array([3.0, 4.0])
    assert twice_the_root(values) == 10.0
    (machine_code,) = (root for root in tmp_path.rglob("*.nbc") if "twice_the_root" in root.name)
    assert b"simnav.root_of_squares." in machine_code.read_bytes()
    assert b"sum_of_squares" not in machine_code.read_bytes()
    with pytest.raises(ValueError, match="nothing"):
        twice_the_root(np.empty(0))
    command = [sys.executable, "-c", "from test_compiled import *; print(twice_the_root(np.array([3.0, 4.0])))"]
    env = surroundings(tmp_path, PYTHONPATH=os.pathsep.join([str(Path(__file__).parent), *sys.path]))
    loaded = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    assert loaded.stdout == "10.0\n"


def _total(values: Vector) -> float:
    return values[0] + values[1]


_helper = compiled.Kernel(_total, typed=False, borrows=True)


def _twice(values: Vector) -> float:
    return 2.0 * _helper(values)


def test_how_helpers_are_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """They leave vector instructions to their callers."""
    from numba.core import config
    from numba.core.compiler import CompilerBase

    allowed = []
    compile_one = CompilerBase.compile_extra

    def record(self, function):
        allowed.append((function.__name__, bool(config.SLP_VECTORIZE)))
        return compile_one(self, function)

    monkeypatch.setattr(CompilerBase, "compile_extra", record)
    monkeypatch.setattr(compiled, "cache_directory", lambda: None)
    before = config.SLP_VECTORIZE
    caller = compiled.Kernel(_twice, typed=True)
    assert caller(np.array([1.0, 2.0])) == 6.0
    # A helper is in the cache for all its callers, whichever of them compiled it first.
    assert sorted(allowed) == [("_total", False), ("_twice", True)]
    assert before == config.SLP_VECTORIZE


def _second(values: Vector) -> float:
    return values.view(PAIR)[0].second


PAIR = structure(first=float, second=float)


def test_machine_code_is_made_for_kernels_and_not_for_their_helpers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "cache_directory", lambda: None)
    caller, part = compiled.Kernel(_twice, typed=True), compiled.Kernel(_total, typed=False, borrows=True)
    monkeypatch.setitem(globals(), "_helper", part)
    assert caller(np.array([1.0, 2.0])) == 6.0
    made = [next(iter(k.compile().overloads.values())).library._made for k in (caller, part)]  # type: ignore[attr-defined]
    assert made == [True, False]


def test_a_structure_of_the_wrong_length_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "cache_directory", lambda: None)
    second = compiled.Kernel(_second, typed=True)
    assert second(np.array([1.0, 2.0, 3.0, 4.0])) == 2.0
    with pytest.raises(ValueError, match="must be a multiple of that of the structure"):
        second(np.array([1.0, 2.0, 3.0]))


def _room(n: int) -> Vector:
    return np.empty(n)


def test_a_helper_that_borrows_its_arrays_makes_none(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core.errors import NumbaError

    monkeypatch.setattr(compiled, "cache_directory", lambda: None)
    with pytest.raises(NumbaError, match="array passed into the function"):
        compiled.Kernel(_room, typed=True, borrows=True).compile()


def test_no_kernel_takes_or_returns_different_values_by_their_places() -> None:
    """More than three are a named record; a few numbers of one sort, such as four weights, are a small vector."""
    warmup._import_all()
    places = {
        f"{k}: {name}"
        for k in compiled._kernels
        for name, hint in hints_of(k.function).items()
        if get_origin(hint) is tuple and len(get_args(hint)) > 3 and len(set(get_args(hint))) > 1
    }
    assert places == set()
