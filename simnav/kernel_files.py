"""The cache of kernels: files with a checksum, so that a damaged one is never executed, loaded without the compiler.

Numba writes two files for each kernel, an index and the machine code. It reads them without a check, and damaged
machine code may end the process. Here each file ends with its SHA-256 digest. A file whose digest is wrong is removed,
with a warning, and the kernel is compiled again.

This module imports Numba; `simnav.compiled` imports it when the first kernel is compiled.
"""

from __future__ import annotations

import contextlib
import copy
import hashlib
import io
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from llvmlite import binding, ir
from numba.core import base, imputils, pythonapi, typeinfer, types
from numba.core import config as numba_config
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.runtime.nrt import rtsys
from numba.experimental import structref
from numba.np import arrayobj

from simnav.kernel_code import libraries

__all__ = ["WithDigests", "call_by_symbol", "compile_with", "record_type", "structures_in"]

_DIGEST = hashlib.sha256().digest_size


_Files: Any = IndexDataCacheFile  # Numba has no annotations
_Cache: Any = FunctionCache
_user_function: Any = imputils.user_function
_Overloads: Any = base.OverloadSelector
_Reference: Any = types.StructRef
structures: Any = structref
boxing: Any = pythonapi
arrays: Any = arrayobj
lowering: Any = imputils
config: Any = numba_config


class WithoutCompiler(_Cache):  # type: ignore[misc]
    """The cache of a kernel, which loads it without Numba's compiler.

    Numba prepares its compiler before it looks for a file, which takes a third of a second in each process. A kernel
    that was compiled needs the memory functions of Numba only; a compilation prepares the compiler by itself.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Not a helper that takes functions: no other process has the same ones, and finds it."""
        if not any(isinstance(kind, types.Dispatcher) for kind in getattr(sig, "args", sig)):
            super().save_overload(sig, data)


class WithDigests(_Files):  # type: ignore[misc]
    """Index and data file of a kernel, with their digests at the end. Pickle does not read what follows an object."""

    @contextlib.contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BinaryIO]:
        content = io.BytesIO()
        yield content
        with super()._open_for_write(filepath) as file:
            file.write(content.getvalue() + hashlib.sha256(content.getvalue()).digest())

    def _load_index(self) -> dict[Any, str]:
        found: dict[Any, str] = super()._load_index() if self._is_whole(self._index_path) else {}
        return found

    def _load_data(self, name: str) -> Any:
        if not self._is_whole(self._data_path(name)):
            raise FileNotFoundError(self._data_path(name))  # it is then compiled, as any kernel without a file
        return super()._load_data(name)

    def _is_whole(self, path: str) -> bool:
        """Whether a file is there and has the digest that it should have; a damaged one is removed."""
        try:
            content = Path(path).read_bytes()
        except FileNotFoundError:
            return False
        if hashlib.sha256(content[:-_DIGEST]).digest() == content[-_DIGEST:]:
            return True
        name = os.path.basename(path)
        warnings.warn(
            f"the compiled kernel {name.partition('-')[0].rpartition('.')[2]} in {os.path.dirname(path)} is damaged "
            f"({name} does not have the digest that it was written with); it is compiled again",
            stacklevel=2,
        )
        with contextlib.suppress(OSError):  # of a cache that cannot be written to
            os.unlink(path)
        return False


def compile_with(dispatcher: Any, signature: str | None, fast: bool) -> None:
    """Compile a dispatcher of Numba for a signature, or load it, with files that have digests if it has a cache.

    Parameters
    ----------
    dispatcher : numba.core.dispatcher.Dispatcher
        A function decorated by `numba.jit` without a signature.
    signature : str or None
        Numba signature. None: Numba compiles the function later, for each caller, as a helper.
    fast : bool
        Whether it has fast arithmetic: then it is compiled as by Numba alone (`simnav.kernel_code`).
    """
    cache = getattr(dispatcher, "_cache", None)
    if cache is None:  # NUMBA_DISABLE_JIT: it is the plain function
        return
    if hasattr(cache, "_cache_file"):
        cache._cache_file.__class__ = WithDigests  # Numba has no public way to choose these classes
        cache.__class__ = WithoutCompiler
    if signature is None:
        # Vector instructions for statements side by side are left to the callers. A loop over a helper that has them
        # could not become a loop of vector instructions; and the cache of a helper is that of all its callers.
        compile_for: Callable[[Any], Any] = dispatcher.compile

        def compile_plainly(types: Any) -> Any:
            previous, config.SLP_VECTORIZE = config.SLP_VECTORIZE, False
            try:
                with libraries(dispatcher.targetctx, on_demand=not fast):
                    return compile_for(types)
            finally:
                config.SLP_VECTORIZE = previous

        dispatcher.compile = compile_plainly
    else:
        with (
            typeinfer.register_dispatcher(dispatcher),  # as `numba.jit` with a signature does
            libraries(dispatcher.targetctx, on_demand=not fast),
        ):
            dispatcher.compile(signature)
        dispatcher.disable_compile()


def call_by_symbol(dispatcher: Any, symbol: str) -> None:
    """Make the functions that call a compiled one call it by a symbol.

    By itself Numba puts a copy of the code of each function that it has compiled into every function that calls it, and
    compiles the copy again. A quarter of the machine code of all kernels was such copies.

    Parameters
    ----------
    dispatcher : numba.core.dispatcher.Dispatcher
        A function that is compiled or loaded, for one signature.
    symbol : str
        The name of its code: the machine code of a caller is kept in a file, and refers to it by this name.
    """
    compiled = list(getattr(dispatcher, "overloads", {}).values())
    if not compiled:  # NUMBA_DISABLE_JIT
        return
    (result,) = compiled
    binding.add_symbol(symbol, result.library.get_pointer_to_function(result.fndesc.mangled_name))
    described = copy.copy(result.fndesc)
    described.mangled_name = symbol
    call = _user_function(described, ())  # the second are the libraries that a caller would contain
    calls = _Overloads()
    calls.append(call, call.signature)
    dispatcher.targetctx._defns[result.entry_point] = calls  # Numba has no public way to do this


@structures.register
class RecordType(_Reference):  # type: ignore[misc]
    """The type of a reference to a record (`simnav.records.Record`), with a short name."""

    def __init__(self, name: str, fields: Any):
        super().__init__(fields)
        described = " ".join(f"{field}: {kind}" for field, kind in self._fields)
        self.name = f"{name}<{hashlib.blake2b(described.encode(), digest_size=6).hexdigest()}>"


class _Structure:
    """What compiled code returns for a record: the owner of its structure."""

    def __init__(self, meminfo: Any):
        self._meminfo = meminfo


_pointer_to: Any = types.MemInfoPointer
_POINTER: Any = _pointer_to(types.voidptr)


@boxing.box(RecordType)  # type: ignore[untyped-decorator]
def _returned(kind: Any, value: Any, c: Any) -> Any:
    """A record that compiled code returns to Python."""
    structure = structures._Utils(c.context, c.builder, kind).get_struct_ref(value)
    owner = c.pyapi.unserialize(c.pyapi.serialize_object(_Structure))
    meminfo = c.box(_POINTER, structure.meminfo)
    returned = c.pyapi.call_function_objargs(owner, [meminfo])
    c.pyapi.decref(owner)
    c.pyapi.decref(meminfo)
    return returned


@boxing.unbox(RecordType)  # type: ignore[untyped-decorator]
def _taken(kind: Any, record: Any, c: Any) -> Any:
    """A record that Python hands over to compiled code.

    Its attribute is asked for by an interned string. By itself Numba makes a new string each time, and Python's cache
    of attributes keeps some thousands of them.
    """
    intern = ir.FunctionType(c.pyapi.pyobj, [c.pyapi.cstring])
    text = c.context.insert_const_string(c.builder.module, "_meminfo")
    name = c.builder.call(c.pyapi._get_function(intern, name="PyUnicode_InternFromString"), [text])
    owner = c.pyapi.object_getattr(record, name)
    c.pyapi.decref(name)
    meminfo = c.unbox(_POINTER, owner).value
    structure = structures._Utils(c.context, c.builder, kind).new_struct_ref(meminfo)
    c.pyapi.decref(owner)
    return boxing.NativeValue(structure._getvalue())


def record_type(name: str, fields: Mapping[str, Any]) -> Any:
    """The type of a record with fields of these types of Numba."""
    return RecordType(name, list(fields.items()))


_ARRAY: Any = types.Array(types.float64, 1, "C")


@lowering.lower_builtin("array.view", _ARRAY, types.DTypeSpec)  # type: ignore[untyped-decorator]
def structures_in(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """An array of float64, seen as structures (`simnav.structures`).

    By itself Numba compiles a function with the checks of NumPy for each structure, a twentieth of the time of all
    kernels. For an array without gaps it is enough that its length is a multiple of that of the structure.
    """
    seen = signature.return_type
    array = arrays.make_array(_ARRAY)(context, builder, arguments[0])
    view = arrays.make_array(seen)(context, builder)
    size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(seen.dtype)))
    length = builder.mul(array.nitems, array.itemsize)
    misfit = builder.icmp_signed("!=", builder.srem(length, size), size.type(0))
    with builder.if_then(misfit, likely=False):
        message = "the length of an array must be a multiple of that of the structure which it is seen as"
        context.call_conv.return_user_exc(builder, ValueError, (message,))
    arrays.populate_array(
        view,
        data=builder.bitcast(array.data, view.data.type),
        shape=[builder.sdiv(length, size)],
        strides=[size],
        itemsize=size,
        meminfo=array.meminfo,
        parent=array.parent,
    )
    return lowering.impl_ret_borrowed(context, builder, seen, view._getvalue())
