"""Records: one argument with named fields, in compiled code and in plain Python."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from simnav.compiled import Kernel, kernel
from simnav.kernel_types import Matrix, Vector, numba_type
from simnav.records import Record


class Scale(NamedTuple):
    """Two numbers that belong together."""

    factor: float
    offset: float


class Machine(Record):
    """A state, and a function that moves it."""

    state: Vector
    table: Matrix
    move: Callable[[Vector, float], float]


@kernel(passed=True)
def add(state: Vector, dt: float) -> float:
    """Add to all elements; their sum."""
    total = 0.0
    for i in range(state.size):
        state[i] += dt
        total += state[i]
    return total


@kernel
def run(machine: Machine, scale: Scale, n: int) -> float:
    """Move the state several times."""
    total = 0.0
    for _ in range(n):
        total += scale.factor * machine.move(machine.state, machine.table[0, 1]) + scale.offset
    return total


def machine(move: Callable[[Vector, float], float] = add) -> Machine:
    return Machine(state=np.zeros(3), table=np.array([[1.0, 2.0]]), move=move)


def plainly(state: Vector, dt: float) -> float:
    """As `add`, without a compiler."""
    state += dt
    return float(state.sum())


def test_kernel_and_its_source_do_the_same_with_a_record() -> None:
    one, other, third = machine(), machine(), machine(plainly)
    assert one.compiled
    assert not third.compiled
    expected = 6.0 + 12.0 + 18.0
    assert run(one, Scale(1.0, 0.0), 3) == expected
    assert run.function(other, Scale(1.0, 0.0), 3) == expected
    assert run.function(third, Scale(1.0, 0.0), 3) == expected
    for each in (one, other, third):
        np.testing.assert_array_equal(each.state, 6.0)
    assert run(one, Scale(2.0, 1.0), 1) == 2.0 * 24.0 + 1.0


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda m: pickle.loads(pickle.dumps(m))], ids=["copy", "pickle"])
def test_a_copy_has_arrays_of_its_own(copied: Callable[[Machine], Machine]) -> None:
    one = machine()
    run(one, Scale(1.0, 0.0), 1)
    other = copied(one)
    run(other, Scale(1.0, 0.0), 1)
    np.testing.assert_array_equal(one.state, 2.0)
    np.testing.assert_array_equal(other.state, 4.0)


def test_a_field_of_another_type_is_refused() -> None:
    with pytest.raises(TypeError, match="No matching definition"):
        run(Machine(state=np.zeros(3, np.int64), table=np.eye(2), move=add), Scale(1.0, 0.0), 1)
    with pytest.raises(TypeError, match="missing 1 required keyword-only argument: 'move'"):
        Machine(state=np.zeros(3), table=np.eye(2))


def test_compiled_code_takes_no_python_function() -> None:
    with pytest.raises(TypeError, match="Machine holds a Python function"):
        run(machine(plainly), Scale(1.0, 0.0), 1)


def without(x: float, y) -> float:  # type: ignore[no-untyped-def]
    """A function with an annotation too few."""
    return x


def of_text(x: str) -> float:
    """A function of something that no kernel takes."""
    return 0.0


def test_what_is_missing_or_wrong_in_annotations_is_named() -> None:
    with pytest.raises(TypeError, match="without: y needs an annotation"):
        Kernel(without, typed=True)
    with pytest.raises(TypeError, match=r"of_text: <class 'str'> is no type of a kernel's argument"):
        _ = Kernel(of_text, typed=True).signature


def test_types_of_annotations() -> None:
    from numba import types

    assert numba_type(Vector) == types.float64[::1]
    assert numba_type(tuple[float, float]) == types.UniTuple(types.float64, 2)
    assert numba_type(Callable[[Vector], float]) == types.FunctionType(types.float64(types.float64[::1]))
    assert numba_type(Scale).fields == ("factor", "offset")
