"""A recurrent network in compiled form: one layer of gated units, and linear outputs.

With the input x, the memory h and the logistic function s,

    ``r = s(W_r x + U_r h + b_r)``,  ``z = s(W_z x + U_z h + b_z)``,
    ``n = tanh(W_n x + b_n + r (U_n h + c_n))``,  ``h <- (1 - z) n + z h``,  ``y = V h + c``.

Source: K. Cho, B. van Merrienboer, C. Gulcehre et al., *Learning phrase representations using RNN encoder-decoder for
statistical machine translation*, EMNLP 2014, in the form of PyTorch, which multiplies ``U_n h + c_n`` by r.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, tanh

import numpy as np

from simnav.compiled import kernel
from simnav.kernel_types import Vector
from simnav.types import Array

__all__ = ["ARRAYS", "advance", "fitting", "flat", "shapes", "size_of"]

#: The arrays of a network, in the order in which `flat` joins them.
ARRAYS = ("input_weight", "input_bias", "memory_weight", "memory_bias", "output_weight", "output_bias")


def shapes(inputs: int, units: int) -> dict[str, tuple[int, ...]]:
    """The shape of each array of a network with one output; gates r, z, n one after the other."""
    rows = 3 * units
    return {
        "input_weight": (rows, inputs), "input_bias": (rows,), "memory_weight": (rows, units), "memory_bias": (rows,),
        "output_weight": (units,), "output_bias": (1,),
    }  # fmt: skip


def fitting(inputs: int, arrays: Mapping[str, Array]) -> dict[str, tuple[int, ...]]:
    """The shapes that some arrays should have, by the length of their output weight."""
    return shapes(inputs, np.size(arrays.get("output_weight", ())))


def size_of(inputs: int, units: int) -> int:
    """The number of parameters.

    >>> size_of(2, 3)
    67
    """
    return sum(int(np.prod(shape)) for shape in shapes(inputs, units).values())


def flat(arrays: Mapping[str, Array]) -> Array:
    """All parameters in one array, as `advance` takes them."""
    joined: Array = np.concatenate([np.asarray(arrays[name], dtype=np.float64).ravel() for name in ARRAYS])
    return joined


@kernel
def advance(weights: Vector, inputs: Vector, memory: Vector, outputs: Vector) -> None:
    """Take one input, and compute the outputs.

    Parameters
    ----------
    weights : (p,) array
        The parameters, from `flat`.
    inputs : (n,) array
        x.
    memory : (m,) array
        h; updated.
    outputs : (k,) array
        y; overwritten.
    """
    n, m, k = inputs.size, memory.size, outputs.size
    rows = 3 * m
    bias = rows * n
    inner = bias + rows
    inner_bias = inner + rows * m
    output = inner_bias + rows
    from_inputs, from_memory = np.empty(rows), np.empty(rows)
    for i in range(rows):
        a, b = weights[bias + i], weights[inner_bias + i]
        for j in range(n):
            a += weights[i * n + j] * inputs[j]
        for j in range(m):
            b += weights[inner + i * m + j] * memory[j]
        from_inputs[i], from_memory[i] = a, b
    for i in range(m):
        reset = 1.0 / (1.0 + exp(-from_inputs[i] - from_memory[i]))
        keep = 1.0 / (1.0 + exp(-from_inputs[m + i] - from_memory[m + i]))
        new = tanh(from_inputs[2 * m + i] + reset * from_memory[2 * m + i])
        memory[i] = (1.0 - keep) * new + keep * memory[i]
    for j in range(k):
        outputs[j] = weights[output + k * m + j]
        for i in range(m):
            outputs[j] += weights[output + j * m + i] * memory[i]
