"""Intermediate states: times between nodes at which readings are predicted, by the motion from the node before.

A reading at an intermediate state is a reading of its node: its Jacobian goes through the motion from the node, and the
noise of that motion is added to its own (`simnav.estimators.models.chain`).
"""

from __future__ import annotations

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.whitening import whitening
from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.records import Record
from simnav.types import Array

__all__ = ["IntermediateStates", "add_motion_noise", "add_noise", "through_motion", "through_one"]


class IntermediateStates(Record):
    """The intermediate states of a window as kernels take them: whole columns.

    Attributes
    ----------
    node : (J,) array of int
        Number of the node before it since the start of the run.
    time : (J,) array
        Time [s].
    transition, noise : (J, n, n) arrays
        Of the motion from the node, as predicted.
    shift : (J, n) array
        By how much the node has moved since the prediction.
    jacobian : (J, n, n) array
        Derivative of the motion by the node.
    """

    node: IntegerVector
    time: Vector
    transition: Stack
    noise: Stack
    shift: Matrix
    jacobian: Stack


@helper
def through_one(transition: Array, coupled: int, jacobian: Array, at_node: Array) -> None:
    """Do `through_motion` for the (3, n) Jacobian of one measurement; ``at_node`` (n,) is work space."""
    n = transition.shape[0]
    for r in range(3):
        for c in range(n):
            at_node[c] = 0.0
        for j in range(n):
            x = jacobian[r, j]
            if x != 0.0:
                if j < coupled:
                    for c in range(coupled):
                        at_node[c] += x * transition[j, c]
                else:
                    at_node[j] += x * transition[j, j]
                    if j + 1 < n and transition[j, j + 1] != 0.0:
                        at_node[j + 1] += x * transition[j, j + 1]
        for c in range(n):
            jacobian[r, c] = at_node[c]


@kernel
def through_motion(first: int, row: IntegerVector, coupled: int, transition: Stack, jacobian: Stack) -> None:
    """Convert Jacobians with respect to intermediate states to Jacobians with respect to their nodes, in place.

    Parameters
    ----------
    first : int
        Index of the first aiding factor that is converted.
    row : (M,) int array
        Index of the intermediate state of each aiding factor; -1 for factors at their nodes.
    coupled : int
        States from this index on are independent and only decay; each may also move by the one after it.
    transition : (J, n, n) array
        Transition matrices from the nodes to the J intermediate states.
    jacobian : (M, 3, n) array
        Jacobians with respect to the intermediate states; overwritten.
    """
    at_node = np.empty(transition.shape[1])
    for i in range(first, row.size):
        if row[i] >= 0:
            through_one(transition[row[i]], coupled, jacobian[i], at_node)


@helper
def add_noise(H: Array, components: int, Q: Array, noise: Array, whitener: Array, cross: Array) -> None:
    """Do `add_motion_noise` for one measurement; ``cross`` (n,) is work space."""
    n = H.shape[1]
    for a in range(components):
        for c in range(n):
            cross[c] = 0.0
        for j in range(n):
            x = H[a, j]
            if x != 0.0:
                for c in range(n):
                    cross[c] += x * Q[j, c]
        for b in range(components):
            x = 0.0
            for c in range(n):
                x += cross[c] * H[b, c]
            noise[a, b] += x
    whitening(noise, whitener)


@kernel
def add_motion_noise(
    first: int,
    row: IntegerVector,
    components: IntegerVector,
    jacobian: Stack,
    motion_noise: Stack,
    noise: Stack,
    whitener: Stack,
    bare: IntegerVector,
) -> None:
    """Add the noise Q of the motion up to a state to the noise R of the measurements there, ``R + H Q H'``, once.

    Parameters
    ----------
    first : int
        Index of the first aiding factor that is changed.
    row : (M,) int array
        Index of the intermediate state of each aiding factor; -1 for factors at their nodes.
    components : (M,) int array
        Number of components of each measurement.
    jacobian : (M, 3, n) array
        Jacobian H with respect to the intermediate state.
    motion_noise : (J, n, n) array
        Process noise Q of the motions from the nodes to the J intermediate states.
    noise, whitener : (M, 3, 3) arrays
        Noise R of the measurements and its inverse Cholesky factor; overwritten.
    bare : (M,) int array
        1 if the motion noise has not been added yet; overwritten with 0.
    """
    cross = np.empty(jacobian.shape[2])
    for i in range(first, row.size):
        if row[i] >= 0 and bare[i] != 0:
            bare[i] = 0
            add_noise(jacobian[i], components[i], motion_noise[row[i]], noise[i], whitener[i], cross)
