"""The `kernel` decorator: Numba kernels that are loaded when first called, with a cache that is never out of date.

The import of a module with kernels is quick: Numba is imported, and a kernel is compiled or loaded from the cache,
only when the kernel is first called. Numba's own cache detects an edit of the file that holds a kernel, but not an edit
of a kernel in another file that it calls. Therefore the cache directory of a kernel is named after a hash of its code,
of all kernels and constants that it uses, directly or indirectly, and of the versions of Python, Numba and NumPy. An
edit of any of these gives a new directory. Each file has a checksum (`simnav.kernel_files`).
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import sys
import threading
import time
import types
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, ParamSpec, Protocol, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from simnav.cache_folder import cache_directory
from simnav.kernel_types import hints_of, numba_type
from simnav.watchers import announce, announced, awaited

__all__ = [
    "Array",
    "Flags",
    "Integers",
    "Kernel",
    "announced",
    "cache_directory",
    "helper",
    "kernel",
    "kernels",
    "prune",
    "ready",
    "register",
]

#: The array type of kernels, and of everything else in simnav: float64.
Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")

_FLOAT = np.dtype(np.float64)
#: Cache directories that were not used for this long are deleted by `prune` [s].
KEEP = 60 * 86400.0

_kernels: list[Kernel[..., Any]] = []
_compiling = threading.RLock()  # Numba takes the cache directory from a global setting


class Kernel(Generic[Parameters, Returned]):
    """A function that Numba compiles on first use.

    Parameters
    ----------
    function : callable
        The plain Python function that is compiled.
    typed : bool
        True: it is compiled for the types of its annotations only (`simnav.kernel_types`), and can be compiled before
        its first call. False: it is a small helper that other kernels call; a call from Python runs it as Python.
    fastmath : bool or set of str
        Permitted changes of floating-point arithmetic; passed to Numba.
    borrows, passed : bool
        See `kernel`.
    """

    def __init__(
        self,
        function: Callable[Parameters, Returned],
        typed: bool,
        fastmath: bool | set[str] = False,
        borrows: bool = False,
        passed: bool = False,
    ):
        assert isinstance(function, types.FunctionType)
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        missing = [name for name in (*names, "return") if name not in function.__annotations__]
        if typed and missing:
            raise TypeError(
                f"kernel {function.__module__}.{function.__name__}: {', '.join(missing)} needs an annotation"
            )
        self.function: types.FunctionType = function
        self.typed = typed
        self.fastmath = fastmath
        self.borrows = borrows
        self.passed = passed
        self._dispatcher: Callable[..., Any] | None = None
        self._entry: Callable[..., Any] | None = None
        self.__name__ = function.__name__
        self.__qualname__ = function.__qualname__
        self.__doc__ = function.__doc__
        self.__module__ = function.__module__
        self.__wrapped__ = function

    def __repr__(self) -> str:
        return f"<kernel {self.__module__}.{self.__name__}>"

    def __reduce__(self) -> str:
        return self.__qualname__  # pickled by name, like a function

    @cached_property
    def signature(self) -> Any:
        """The signature of Numba, from the annotations; None for a helper."""
        if not self.typed:
            return None
        hints = hints_of(self.function)
        try:
            return numba_type(hints.pop("return"))(*map(numba_type, hints.values()))
        except TypeError as error:
            raise TypeError(f"kernel {self.__module__}.{self.__name__}: {error}") from None

    def tree(self) -> list[Kernel[..., Any]]:
        """This kernel and all kernels that it calls, directly or indirectly."""
        found: list[Kernel[..., Any]] = []
        todo: list[Kernel[..., Any]] = [self]
        while todo:
            k = todo.pop()
            if k not in found:
                found.append(k)
                todo += [value for _, value in _uses(k.function) if isinstance(value, Kernel)]
        return found

    def fingerprint(self) -> str:
        """Hash of the code and the constants that decide what this kernel computes (see the module)."""
        import numba
        import numpy as np

        from simnav.kernel_code import LibraryOnDemand
        from simnav.kernel_files import call_by_symbol, compile_with, structures_in

        text = [str(sys.implementation.cache_tag), numba.__version__, np.__version__]
        functions = (Kernel._jit, compile_with, call_by_symbol, structures_in, LibraryOnDemand._optimize_functions)
        for function in functions:  # what decides how kernels are compiled
            text += _code_text(function.__code__)
        for k in self.tree():
            fastmath = sorted(k.fastmath) if isinstance(k.fastmath, set) else k.fastmath
            text += [k.__module__, k.__qualname__, f"{k.signature} {fastmath!r} {k.borrows!r} {k.passed!r}"]
            # The code in memory is hashed, not the file: a file may be edited after it was imported.
            text += _code_text(k.function.__code__)
            text.append(repr(k.function.__defaults__))
            for name, value in _uses(k.function):
                if not isinstance(value, Kernel):
                    text += [name, *_value_text(value)]
        return hashlib.blake2b("\0".join(text).encode(errors="replace"), digest_size=8).hexdigest()

    def directory(self) -> Path | None:
        """The cache directory of this kernel with its present code, or None if there is no cache."""
        root = cache_directory()
        # Without a file (a notebook, a console) Numba would fall back on a cache that we do not control.
        if root is None or not os.path.exists(self.function.__code__.co_filename):
            return None
        return root / self.fingerprint()

    def cached(self) -> bool:
        """Whether the cache holds this kernel. It must have a signature."""
        return _holds(self.directory())

    def compile(self) -> Callable[..., Any]:
        """Compile the kernel, or load it from the cache, once. Return the compiled function."""
        with _compiling:
            if self._dispatcher is None:
                directory = self.directory()
                if self.typed and awaited() and not _holds(directory):
                    announce()
                if directory is not None:
                    try:
                        directory.mkdir(mode=0o700, exist_ok=True)
                        os.utime(directory)  # in use: see `prune`
                        self._dispatcher = self._jit(str(directory))
                    except OSError:  # a full disk must not stop a run
                        self._dispatcher = None
                if self._dispatcher is None:
                    self._dispatcher = self._jit(None)
            return self._dispatcher

    def _jit(self, directory: str | None) -> Callable[..., Any]:
        import numba
        from numba.core import config as numba_config

        from simnav.kernel_files import call_by_symbol, compile_with

        config: Any = numba_config
        original = self.function
        namespace = dict(original.__globals__)
        namespace.update(
            {
                name: value.compile()
                for name, value in _uses(original)
                if isinstance(value, Kernel) and value is not self
            }
        )
        closure = original.__closure__
        if closure is not None:
            cells = [c.cell_contents for c in closure]
            closure = tuple(types.CellType(v.compile() if isinstance(v, Kernel) else v) for v in cells)
        function = types.FunctionType(original.__code__, namespace, original.__name__, original.__defaults__, closure)
        function.__qualname__ = original.__qualname__
        function.__module__ = self.__module__
        options: dict[str, Any] = {"nopython": True, "cache": directory is not None, "error_model": "numpy"}
        options["fastmath"] = self.fastmath
        if self.borrows:
            options["_nrt"] = False  # the runtime of Numba, which counts references
        if not self.typed:
            # A helper is inlined: this is faster by a sixth, and keeps results equal to the last bit. Without inlining
            # a helper would exist once in its own library and again in the library of each caller, optimised
            # differently, and the linker uses the copy that is loaded first. With fast arithmetic a result would then
            # depend on whether its kernels came from the cache.
            options["forceinline"] = True
            options["no_cpython_wrapper"] = True
        options["no_cfunc_wrapper"] = not self.passed  # Numba hands a function over by the address of its form for C
        fast = any(k.fastmath for k in self.tree())
        previous = config.CACHE_DIR, config.SLP_VECTORIZE
        # Sums that are written side by side become vector instructions. Each keeps its order; with fast arithmetic it
        # would not, and results would change. Helpers have none of their own (`simnav.kernel_files.compile_with`).
        config.CACHE_DIR, config.SLP_VECTORIZE = directory or previous[0], not fast
        try:
            compiled: Callable[..., Any] = numba.jit(**options)(function)
            compile_with(compiled, self.signature, fast)
            if self.typed and not fast:
                # Its callers contain a call of it, and no copy of its code. They are compiled, or loaded, after it.
                code = self.fingerprint() if directory is None else os.path.basename(directory)
                call_by_symbol(compiled, f"simnav.{self.__qualname__}.{code}")
        finally:
            config.CACHE_DIR, config.SLP_VECTORIZE = previous
        return compiled

    @cached_property
    def _takes_records(self) -> bool:
        """Whether an argument is a record or a named tuple."""
        hints = hints_of(self.function).values()
        return any(isinstance(h, type) and (hasattr(h, "numba_type") or issubclass(h, tuple)) for h in hints)

    @cached_property
    def _records(self) -> tuple[int, ...]:
        """Which of its arguments are records."""
        hints = hints_of(self.function)
        names = self.function.__code__.co_varnames[: self.function.__code__.co_argcount]
        return tuple(i for i, name in enumerate(names) if hasattr(hints[name], "numba_fields"))

    @property
    def unchecked(self) -> Callable[Parameters, Returned]:
        """The compiled function without the check of its arguments, which takes a microsecond for twenty arrays.

        Only for arguments that have the types of the signature by construction: an array of another type or layout
        would be misread, without a message.
        """
        if self._entry is None:
            function = self.compile()
            overloads = getattr(function, "overloads", None)  # NUMBA_DISABLE_JIT: it is the plain function
            self._entry = function if overloads is None else next(iter(overloads.values())).entry_point
        return self._entry

    if TYPE_CHECKING:

        def __call__(self, *args: Parameters.args, **kwargs: Parameters.kwargs) -> Returned: ...

    else:

        def __call__(self, *args: Any) -> Any:
            if not self.typed:  # a helper is compiled within its callers; alone it would be at the first call,
                return self.function(*args)  # in every process anew, and a confined one cannot write what it compiles
            if self._takes_records:  # Numba would keep each of them for good where it checks its type
                for i in self._records:
                    if not args[i].compiled:
                        _ = args[i]._numba_type_  # it says why compiled functions cannot take it
                return self.unchecked(*args)
            return (self._dispatcher or self.compile())(*args)


def _holds(directory: Path | None) -> bool:
    """Whether a directory of the cache holds a compiled kernel."""
    return directory is not None and any(directory.glob("*/*.nbi"))


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    """A code object and those nested in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)


def _code_text(code: types.CodeType) -> Iterator[str]:
    """The parts of a code object that decide what it computes: not its line numbers, not its file."""
    for c in _codes(code):
        yield c.co_code.hex()
        yield repr((c.co_argcount, c.co_names, c.co_varnames, c.co_freevars, c.co_cellvars))
        for constant in c.co_consts:
            if isinstance(constant, frozenset):
                yield repr(sorted(map(repr, constant)))
            elif not isinstance(constant, types.CodeType):
                yield repr(constant)


def _uses(function: types.FunctionType) -> Iterator[tuple[str, Any]]:
    """The globals, closure variables and module attributes that a function names, and their values."""
    namespace = function.__globals__
    code: types.CodeType = function.__code__
    names = list(dict.fromkeys(name for c in _codes(code) for name in c.co_names))
    for name in names:
        value = namespace.get(name)
        if isinstance(value, types.ModuleType) and value.__name__.partition(".")[0] not in sys.stdlib_module_names:
            if value.__name__.partition(".")[0] != "numpy":
                yield from ((f"{name}.{n}", vars(value)[n]) for n in names if n in vars(value))
        elif name in namespace:
            yield name, value
    for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents


def _value_text(value: Any) -> list[str]:
    """A constant as text: the parts of it that become constants of a compiled function."""
    import numpy as np

    if isinstance(value, np.ndarray):
        return [f"{value.dtype}{value.shape}", value.tobytes().hex()]
    if isinstance(value, tuple):
        return [type(value).__name__, *(t for v in value for t in _value_text(v)), ")"]
    if isinstance(value, (bool, int, float, complex, str, bytes, np.generic, np.dtype)):
        return [f"{type(value).__name__} {value!r}"]
    plain = getattr(value, "py_func", None)  # a function compiled by Numba directly
    if isinstance(plain, types.FunctionType):
        inner = [(n, v) for n, v in _uses(plain) if v is not value]
        return [*_code_text(plain.__code__), *(t for n, v in inner for t in [n, *_value_text(v)])]
    if isinstance(value, type):
        return [value.__qualname__, repr(getattr(value, "_fields", ()))]  # a named tuple
    return []


def ready(array: Array) -> Array:
    """The array in the form that kernels need: float64, C-contiguous and writable. It is copied only if necessary."""
    if array.flags.carray and (array.dtype is _FLOAT or array.dtype == _FLOAT):
        return array
    return np.array(array, dtype=np.float64, order="C")


class _Decorator(Protocol):
    """What makes a function a kernel."""

    def __call__(self, function: Callable[Parameters, Returned], /) -> Kernel[Parameters, Returned]: ...


@overload
def kernel(function: Callable[Parameters, Returned], /) -> Kernel[Parameters, Returned]: ...


@overload
def kernel(*, fastmath: bool | set[str] = False, borrows: bool = False, passed: bool = False) -> _Decorator: ...


def kernel(
    function: Callable[..., Any] | None = None,
    *,
    fastmath: bool | set[str] = False,
    borrows: bool = False,
    passed: bool = False,
) -> Any:
    """Make a function a `Kernel` that Python calls, for the types of its annotations (`simnav.kernel_types`).

    Parameters
    ----------
    function : callable
        The function; None: the result is a decorator with the settings that follow.
    fastmath : bool or set of str
        Permitted changes of floating-point arithmetic; passed to Numba.
    borrows : bool
        True for a function that makes no array, and returns none but its arguments. Numba then counts no references to
        arrays. For a short function in a loop the count may take longer than the work.
    passed : bool
        True for a function that is handed over to other kernels, as an argument or in a record.
    """
    if function is None:
        return partial(kernel, fastmath=fastmath, borrows=borrows, passed=passed)
    return register(Kernel(function, True, fastmath, borrows, passed))


@overload
def helper(function: Callable[Parameters, Returned], /) -> Kernel[Parameters, Returned]: ...


@overload
def helper(*, fastmath: bool | set[str] = False, borrows: bool = False) -> _Decorator: ...


def helper(
    function: Callable[..., Any] | None = None, *, fastmath: bool | set[str] = False, borrows: bool = False
) -> Any:
    """Make a function a `Kernel` that only other kernels call, for any types; it becomes a part of their code.

    Parameters
    ----------
    function, fastmath, borrows
        As of `kernel`.
    """
    if function is None:
        return partial(helper, fastmath=fastmath, borrows=borrows)
    return register(Kernel(function, False, fastmath, borrows))


Made = TypeVar("Made", bound="Kernel[..., Any]")


def register(made: Made) -> Made:
    """Count a kernel among those that are compiled in advance (`kernels`)."""
    _kernels.append(made)
    return made


def kernels() -> list[Kernel[..., Any]]:
    """All kernels that Python calls in the modules that are imported at this time."""
    return [k for k in _kernels if k.typed]


def prune() -> int:
    """Delete the cached kernels that no process has used for `KEEP` seconds. Return their number."""
    root = cache_directory()
    count = 0
    for directory in [] if root is None else root.iterdir():
        with contextlib.suppress(OSError):  # another process may prune, too
            if directory.is_dir() and time.time() - directory.stat().st_mtime > KEEP:
                shutil.rmtree(directory, ignore_errors=True)
                count += 1
    return count
