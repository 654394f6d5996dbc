"""The nodes and factors of a window as the kernels of a window take them: whole columns, and which of their rows.

A window keeps its nodes and factors in columns that have free rows before and after those in use, so that rows come and
go without a copy (`simnav.estimators.models.columns`). A kernel takes the columns by name, and `Rows` says where the
window is in them.
"""

from __future__ import annotations

from typing import NamedTuple

from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.records import Record

__all__ = ["AidingFactors", "Motions", "NewRows", "Nodes", "Prior", "Rows", "Window"]


class Rows(NamedTuple):
    """Where the rows of a window are in its columns.

    Attributes
    ----------
    first_node, nodes : int
        Row of the first node, and number K of the nodes.
    first_motion : int
        Row of the first of the K - 1 motion factors.
    first_aid, aids : int
        Row of the first aiding factor, and number M of the aiding factors.
    first_between, between : int
        Row of the first intermediate state, and their number (`simnav.estimators.models.intermediate_states`).
    base, base_between : int
        Number of the first node, and of the first intermediate state, since the start of the run. Aiding factors and
        intermediate states refer to nodes by such numbers.
    coupled : int
        Components from this one on are errors of instruments. They keep their process noise whatever the weight of a
        motion factor is.
    """

    first_node: int
    nodes: int
    first_motion: int
    first_aid: int
    aids: int
    first_between: int
    between: int
    base: int
    base_between: int
    coupled: int


class NewRows(NamedTuple):
    """How many nodes, aiding factors and intermediate states a step has appended so far."""

    nodes: int
    aids: int
    between: int


class Nodes(Record):
    """The nodes, as the last elimination left them, with n components each.

    Attributes
    ----------
    predicted, filtered : (K, n, n) arrays
        Covariance of each node by all older ones, without its own measurements and with them.
    predicted_shift, filtered_shift : (K, n) arrays
        Means of the same two, minus the node.
    step : (K, n) array
        Correction of each node.
    size : (K,) array
        Largest component of its correction in units of its filtered sigmas; NaN or infinite if it cannot be used.
    """

    predicted: Stack
    predicted_shift: Matrix
    filtered: Stack
    filtered_shift: Matrix
    step: Matrix
    size: Vector


class Motions(Record):
    """The motion factors, each from a node to the next.

    Attributes
    ----------
    transition, noise, whitener : (K - 1, n, n) arrays
        As predicted: transition matrix, process noise Q, and the inverse Cholesky factor of Q.
    begin_shift, end_shift : (K - 1, n) arrays
        By how much the two nodes have moved since the prediction.
    jacobian : (K - 1, n, n) array
        Derivative F of the motion by the older node, at the last linearisation.
    residual, whitened : (K - 1, n) arrays
        Error e, the newer node minus the prediction from the older one; the whitened error.
    norm, weight : (K - 1,) arrays
        Norm of the whitened error; the weight that divides Q of the motion (`Rows.coupled`).
    time : (K - 1,) array
        Time of the node at the end [s].
    """

    transition: Stack
    noise: Stack
    whitener: Stack
    begin_shift: Matrix
    end_shift: Matrix
    jacobian: Stack
    residual: Matrix
    whitened: Matrix
    norm: Vector
    weight: Vector
    time: Vector


class AidingFactors(Record):
    """The aiding factors, one for each measurement, in ascending order of their nodes.

    Attributes
    ----------
    node : (M,) array of int
        Number of the node since the start of the run.
    between : (M,) array of int
        Number of the intermediate state since the start of the run; -1: the measurement is predicted at the node.
    instrument : (M,) array of int
        Which instrument it comes from. Measurements of one instrument on one node are taken as their mean.
    components : (M,) array of int
        Number of components; 0 for a factor that says nothing.
    bare : (M,) array of int
        1 if the noise of the motion from the node has not been added to the noise yet.
    time : (M,) array
        Time of validity [s].
    value : (M, 3) array
        What was measured.
    noise, whitener : (M, 3, 3) arrays
        Covariance R of the noise, and its inverse Cholesky factor.
    jacobian : (M, 3, n) array
        Derivative H of the prediction by the node.
    residual, whitened : (M, 3) arrays
        Measured minus predicted; the whitened residual.
    norm, weight : (M,) arrays
        Norm of the whitened residual; the weight that divides R.
    cross, white : (M, 3, n) arrays
        Of the last elimination: ``L^-1 H P`` and ``L^-1 H``, with ``L L' = S``.
    innovation : (M, 3) array
        Of the last elimination: ``L^-1 (r - H d)``.
    used : (M,) array of int
        1 if the measurement is used, by itself or as a mean; otherwise 0.
    """

    node: IntegerVector
    between: IntegerVector
    instrument: IntegerVector
    components: IntegerVector
    bare: IntegerVector
    time: Vector
    value: Matrix
    noise: Stack
    whitener: Stack
    jacobian: Stack
    residual: Matrix
    whitened: Matrix
    norm: Vector
    weight: Vector
    cross: Stack
    white: Stack
    innovation: Matrix
    used: IntegerVector


class Prior(Record):
    """The prior of the first node.

    Attributes
    ----------
    covariance, whitener : (n, n) arrays
        Covariance without the node's own measurements, and its inverse Cholesky factor.
    shift : (n,) array
        Mean without the node's own measurements, minus the node.
    """

    covariance: Matrix
    whitener: Matrix
    shift: Vector


class Window(Record):
    """The nodes and factors of a window.

    Attributes
    ----------
    nodes : Nodes
    motions : Motions
    aids : AidingFactors
    prior : Prior
    """

    nodes: Nodes
    motions: Motions
    aids: AidingFactors
    prior: Prior
