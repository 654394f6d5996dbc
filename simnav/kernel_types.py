"""The types of a kernel's arguments, as annotations: arrays with their numbers of dimensions, records and functions.

A kernel that Python calls is compiled for the types of its annotations, so they are written once. An array is annotated
by one of the names below, several values by a `typing.NamedTuple` or a `simnav.records.Record`, and a function that is
handed over by ``Callable[[Vector, float], float]``. The module imports Numba only when a type is asked for.
"""

from __future__ import annotations

import collections.abc
import types
import typing
from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "FlagMatrix",
    "FlagVector",
    "Hypermatrix",
    "IntegerMatrix",
    "IntegerStack",
    "IntegerVector",
    "Matrix",
    "Stack",
    "Vector",
    "hints_of",
    "numba_type",
]

#: Arrays of float64 with one, two, three and four dimensions, contiguous as C has them.
Vector: TypeAlias = Annotated[NDArray[np.float64], "float64[::1]"]
Matrix: TypeAlias = Annotated[NDArray[np.float64], "float64[:, ::1]"]
Stack: TypeAlias = Annotated[NDArray[np.float64], "float64[:, :, ::1]"]
Hypermatrix: TypeAlias = Annotated[NDArray[np.float64], "float64[:, :, :, ::1]"]
#: Arrays of int64 with one, two and three dimensions.
IntegerVector: TypeAlias = Annotated[NDArray[np.int64], "int64[::1]"]
IntegerMatrix: TypeAlias = Annotated[NDArray[np.int64], "int64[:, ::1]"]
IntegerStack: TypeAlias = Annotated[NDArray[np.int64], "int64[:, :, ::1]"]
#: Arrays of truth values with one and two dimensions.
FlagVector: TypeAlias = Annotated[NDArray[np.bool_], "boolean[::1]"]
FlagMatrix: TypeAlias = Annotated[NDArray[np.bool_], "boolean[:, ::1]"]

_PLAIN: Mapping[Any, str] = {float: "float64", int: "int64", bool: "boolean", complex: "complex128", type(None): "void"}


def hints_of(function: types.FunctionType | type) -> dict[str, Any]:
    """The annotations of a function or a class, with what `typing.Annotated` says."""
    return typing.get_type_hints(function, include_extras=True)


def numba_type(annotation: Any) -> Any:
    """The type of Numba for an annotation.

    Parameters
    ----------
    annotation : type or annotation
        A number, an array of this module, a tuple of those, a named tuple, a record, or a function of those.

    Raises
    ------
    TypeError
        If a kernel cannot have an argument of this type.
    """
    import numba

    numba_types: Any = numba.types
    if annotation is None or annotation in _PLAIN:
        return getattr(numba_types, _PLAIN[type(None) if annotation is None else annotation])
    origin, inner = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        return eval(inner[1], {"__builtins__": {}}, vars(numba_types))
    if origin is tuple:
        return numba_types.BaseTuple.from_types([numba_type(a) for a in inner])
    if origin is collections.abc.Callable:
        return numba_types.FunctionType(numba_type(inner[-1])(*map(numba_type, inner[0])))
    if isinstance(annotation, type) and hasattr(annotation, "numba_type"):  # a record
        return annotation.numba_type()
    if isinstance(annotation, type) and issubclass(annotation, tuple):
        return numba_types.BaseTuple.from_types([numba_type(a) for a in hints_of(annotation).values()], annotation)
    raise TypeError(
        f"{annotation!r} is no type of a kernel's argument: it should be float, int, bool, an array of "
        "simnav.kernel_types (Vector, Matrix, ...), a tuple or named tuple of those, a Record, or a Callable"
    )
