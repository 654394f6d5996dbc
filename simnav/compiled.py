"""The `kernel` decorator: Numba kernels that load late and whose cache is never stale.

Importing a module with kernels costs nothing: Numba itself is imported, and a kernel compiled or
loaded from the cache, when the first kernel is called. Numba's own cache notices an edit of the
file that holds a kernel, but not of a kernel that it calls in another file. Here every kernel's cache
directory is named after a hash of its source, of all kernels and constants that it uses, directly
or not, and of the versions of Numba and NumPy; an edit anywhere in that tree opens a new one.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import sys
import tempfile
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

__all__ = ["Kernel", "cache_directory", "kernel", "kernels"]

_kernels: list[Kernel] = []


def cache_directory() -> Path:
    """Where compiled kernels are kept: ``$SIMNAV_CACHE_DIR``, or the user's cache directory."""
    chosen = os.environ.get("SIMNAV_CACHE_DIR")
    if chosen:
        return Path(chosen) / "kernels"
    if sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    elif os.name == "nt":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home()))
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    path = base / "simnav" / "kernels"
    try:
        path.mkdir(parents=True, exist_ok=True)
        if os.access(path, os.W_OK):
            return path
    except OSError:
        pass
    return Path(tempfile.gettempdir()) / f"simnav-{os.getuid() if hasattr(os, 'getuid') else 'user'}" / "kernels"


class Kernel:
    """A function that Numba compiles on first use.

    Parameters
    ----------
    function : callable
    signature : str or None
        Numba signature; with it the kernel is compiled for these types and no others, ahead of
        its first call. Small helpers that only other kernels call have none.
    fastmath : bool or set of str
    """

    def __init__(self, function: Callable[..., Any], signature: str | None, fastmath: bool | set[str]):
        self.function = function
        self.signature = signature
        self.fastmath = fastmath
        self._dispatcher: Callable[..., Any] | None = None
        self.__name__ = function.__name__
        self.__qualname__ = function.__qualname__
        self.__doc__ = function.__doc__
        self.__module__ = function.__module__
        self.__wrapped__ = function

    def __repr__(self) -> str:
        return f"<kernel {self.__module__}.{self.__name__}>"

    def _names(self) -> Iterator[str]:
        code = [self.function.__code__]
        while code:
            c = code.pop()
            yield from c.co_names
            code += [k for k in c.co_consts if isinstance(k, types.CodeType)]

    def _uses(self) -> Iterator[tuple[str, Any]]:
        namespace = self.function.__globals__
        for name in dict.fromkeys(self._names()):
            if name in namespace:
                yield name, namespace[name]

    def fingerprint(self) -> str:
        """Hash of all that decides what this kernel computes (see the module)."""
        import numba
        import numpy as np

        text: list[str] = [numba.__version__, np.__version__]
        seen: set[int] = set()
        todo: list[Kernel] = [self]
        while todo:
            k = todo.pop()
            if id(k) in seen:
                continue
            seen.add(id(k))
            text += [k.__module__, repr(k.signature), repr(k.fastmath), inspect.getsource(k.function)]
            for name, value in k._uses():
                if isinstance(value, Kernel):
                    todo.append(value)
                elif isinstance(value, (bool, int, float, complex, str, tuple)):
                    text.append(f"{name}={value!r}")
                elif isinstance(value, np.ndarray):
                    text.append(f"{name}={value.dtype}{value.shape}{value.tobytes()!r}")
        return hashlib.blake2b("\0".join(text).encode(), digest_size=8).hexdigest()

    def compile(self) -> Callable[..., Any]:
        """Compile, or load from the cache, once; return the compiled function."""
        if self._dispatcher is None:
            import numba
            from numba.core import config

            directory = cache_directory() / self.fingerprint()
            namespace = dict(self.function.__globals__)
            for name, value in self._uses():
                if isinstance(value, Kernel):
                    namespace[name] = value.compile()
            function = types.FunctionType(
                self.function.__code__,
                namespace,
                self.function.__name__,
                self.function.__defaults__,
                self.function.__closure__,
            )
            function.__qualname__ = self.function.__qualname__
            function.__module__ = self.__module__
            previous = config.CACHE_DIR
            config.CACHE_DIR = str(directory)
            try:
                options = {"nopython": True, "cache": True, "fastmath": self.fastmath, "error_model": "numpy"}
                decorate = numba.jit(**options) if self.signature is None else numba.jit(self.signature, **options)
                self._dispatcher = decorate(function)
            finally:
                config.CACHE_DIR = previous
        return self._dispatcher

    def __call__(self, *args: Any) -> Any:
        return (self._dispatcher or self.compile())(*args)


def kernel(signature: str | None = None, *, fastmath: bool | set[str] = False) -> Callable[[Callable[..., Any]], Kernel]:
    """Make a function a `Kernel`.

    Parameters
    ----------
    signature : str, optional
        Numba signature (``"void(f8[:, ::1], f8)"``). Every kernel that Python calls has one, so that
        `simnav warmup` can compile it ahead; helpers that only kernels call may go without.
    fastmath : bool or set of str
        Handed to Numba.
    """

    def wrap(function: Callable[..., Any]) -> Kernel:
        k = Kernel(function, signature, fastmath)
        _kernels.append(k)
        return k

    return wrap


def kernels() -> list[Kernel]:
    """All kernels of the modules imported so far that can be compiled ahead."""
    return [k for k in _kernels if k.signature is not None]
