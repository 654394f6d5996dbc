"""Records: named arrays, numbers and functions that a kernel takes as one argument.

A record is declared like a dataclass, and a kernel reads its fields by name::

    class Filter(Record):
        state: Vector
        covariance: Matrix
        propagate: Callable[[Vector, Matrix, float], None]

Kernels share the arrays with Python: what a kernel writes into one, Python reads from it. A function may be a kernel or
any Python function. If all are kernels, a compiled function takes the record; if one is not, its plain source
(`simnav.compiled.Kernel.function`) takes the same record, and does the same.

In compiled code a record is a reference to a structure of Numba, which is made with the record. So the functions in it
are looked up once: Numba takes 30 microseconds for each function that is handed over by itself.
"""

from __future__ import annotations

import dataclasses
import sys
from functools import cached_property
from types import SimpleNamespace
from typing import Any, ClassVar, dataclass_transform

from simnav.compiled import Kernel, register
from simnav.kernel_types import hints_of, numba_type

__all__ = ["Record"]

_types: dict[type[Any], Any] = {}


@dataclass_transform(kw_only_default=True, eq_default=False)
class Record:
    """The base of all records; the fields of a subclass are its annotations, and are given by name."""

    numba_fields: ClassVar[tuple[str, ...]] = ()
    constructor: ClassVar[Constructor]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        dataclasses.dataclass(eq=False, kw_only=True)(cls)
        cls.numba_fields = tuple(field.name for field in dataclasses.fields(cls))  # type: ignore[arg-type]
        cls.constructor = register(Constructor(cls))

    @classmethod
    def numba_type(cls) -> Any:
        """The type of its reference in compiled code."""
        return _type_of(cls)

    @cached_property
    def compiled(self) -> bool:
        """Whether compiled functions can take it: all functions in it are kernels."""
        values = [getattr(self, name) for name in self.numba_fields]
        functions = [v for v in values if callable(v) and not isinstance(v, Record)]
        return all(isinstance(f, Kernel) for f in functions) and all(
            v.compiled for v in values if isinstance(v, Record)
        )

    def __post_init__(self) -> None:
        """Make the structure for compiled code, so that a field of another type is an error here."""
        import numba

        settings: Any = numba.config
        if self.compiled and not settings.DISABLE_JIT:
            _ = self._meminfo

    @property
    def _numba_type_(self) -> Any:
        """What Numba asks an object for; TypeError if compiled functions cannot take it."""
        if not self.compiled:
            raise TypeError(f"{type(self).__name__} holds a Python function, and a compiled function is to take it")
        return self.numba_type()

    @cached_property
    def _meminfo(self) -> Any:
        """The structure in compiled code, which Numba asks an object for."""
        values = [getattr(self, name) for name in self.numba_fields]
        return self.constructor(*(v.compile() if isinstance(v, Kernel) else v for v in values))._meminfo

    @cached_property
    def in_python(self) -> Any:
        """Its fields for a caller in Python, which needs no check of the types of its arguments.

        A kernel is entered without a check (`simnav.compiled.Kernel.unchecked`); one that is to take a record of this
        record with a Python function in it is its plain source.
        """
        values = {name: getattr(self, name) for name in self.numba_fields}
        plain = {type(v) for v in values.values() if isinstance(v, Record) and not v.compiled}
        for name, value in values.items():
            if isinstance(value, Kernel):
                takes = set(hints_of(value.function).values())
                values[name] = value.function if plain & takes else value.unchecked
        return SimpleNamespace(**values)

    def __getstate__(self) -> dict[str, Any]:
        """Its fields: a copy has a structure of its own."""
        return {name: getattr(self, name) for name in self.numba_fields}


def _type_of(cls: type[Record]) -> Any:
    from simnav.kernel_files import record_type

    if cls not in _types:
        hints, name = hints_of(cls), f"{cls.__module__}.{cls.__qualname__}"
        _types[cls] = record_type(name, {field: numba_type(hints[field]) for field in cls.numba_fields})
    return _types[cls]


class Constructor(Kernel[..., Any]):
    """The kernel that makes the structure of a record of its fields; the cache keeps it as if the module held it."""

    def __init__(self, record: type[Record]):
        names, module = record.numba_fields, sys.modules.get(record.__module__)
        lines = [f"def constructor({', '.join(names)}):", "    record = new(record_type)"]
        lines += [f"    record.{name} = {name}" for name in names] + ["    return record"]
        space: dict[str, Any] = {"__name__": record.__module__}
        file = getattr(module, "__file__", None) or "<record>"
        exec(compile("\n".join(lines), file, "exec"), space)  # names of fields only
        function = space["constructor"]
        function.__qualname__ = f"{record.__qualname__}.constructor"
        function.__annotations__ = dict.fromkeys((*names, "return"), Any)
        super().__init__(function, typed=True)
        self.record = record

    @cached_property
    def signature(self) -> Any:
        """The signature of Numba, from the annotations of the record, which can be resolved when it is first used."""
        from numba.experimental.structref import new

        self.function.__globals__.update(new=new, record_type=self.record.numba_type())
        hints = hints_of(self.record)
        return self.record.numba_type()(*(numba_type(hints[name]) for name in self.record.numba_fields))
