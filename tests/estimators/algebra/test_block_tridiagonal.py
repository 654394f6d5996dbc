"""One step of a chain of nodes against the dense normal equations."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimators.algebra.block_tridiagonal import after_step, half_squares, keep_weights, solve_chain, whiten
from simnav.estimators.algebra.whitening import whitening

N, COUNT = 5, 6


class Problem:
    """A random chain; every node but one has measurements of one to three components."""

    def __init__(self, seed: int):
        rng = np.random.default_rng(seed)
        self.prior = covariance(rng, N)
        self.shift = rng.normal(size=N)
        self.F = np.eye(N) + 0.3 * rng.normal(size=(COUNT - 1, N, N))
        self.Q = np.array([0.1 * covariance(rng, N) for _ in range(COUNT - 1)])
        self.e = rng.normal(size=(COUNT - 1, N))
        self.w = rng.uniform(0.2, 1.0, COUNT - 1)
        self.node = np.array([0, 0, 1, 3, 4, 4, 5], dtype=np.int64)
        self.m = np.array([3, 1, 2, 3, 1, 2, 3], dtype=np.int64)
        total = len(self.node)
        self.instrument = np.arange(total)
        self.H = rng.normal(size=(total, 3, N))
        self.r = rng.normal(size=(total, 3))
        self.R = np.array([covariance(rng, 3) for _ in range(total)])
        self.v = rng.uniform(0.2, 1.0, total)

    @property
    def rows(self) -> tuple[int, ...]:
        return 0, COUNT, 0, 0, len(self.node), 7

    def solve(self, damping: float = 0.0, first: int = 0, left: tuple = ()):
        """Largest step; predicted and filtered covariances and shifts, step; and what is left of each measurement.

        ``left`` is what solving returned for the nodes before ``first``.
        """
        total = len(self.node)
        nodes = (
            np.full((COUNT, N, N), np.nan), np.full((COUNT, N), np.nan), np.full((COUNT, N, N), np.nan),
            np.full((COUNT, N), np.nan),
        )  # fmt: skip
        aids = (
            np.full((total, 3, N), np.nan), np.full((total, 3, N), np.nan), np.full((total, 3), np.nan),
            np.zeros(total, np.int64),
        )  # fmt: skip
        for ours, theirs in zip((*nodes, *aids), left):
            rows = first if len(theirs) == COUNT else int(np.searchsorted(self.node, first))
            ours[:rows] = theirs[:rows]
        step = np.empty((COUNT, N))
        size = solve_chain(
            (self.prior, self.shift), self.rows, (self.F, self.Q, self.e, self.w),
            (self.node + 7, self.instrument, self.m, self.H, self.r, self.R, self.v), damping, first,
            nodes, aids, (step, np.empty(COUNT)),
        )  # fmt: skip
        self.left = *nodes, *aids
        return size, (*nodes, step)

    def dense(self, last: int = COUNT, own: bool = True, damping: np.ndarray | None = None):
        """Normal matrix and right side of the first ``last`` nodes, the last with its own measurements or without."""
        A, b = np.zeros((last * N, last * N)), np.zeros(last * N)

        def add(J: np.ndarray, residual: np.ndarray, information: np.ndarray) -> None:
            A[...] += J.T @ information @ J
            b[...] += J.T @ information @ residual

        J = np.zeros((N, last * N))
        J[:, :N] = np.eye(N)
        add(J, self.shift, np.linalg.inv(self.prior))
        for k in range(last - 1):
            J = np.zeros((N, last * N))
            J[:, k * N : (k + 1) * N] = -self.F[k]
            J[:, (k + 1) * N : (k + 2) * N] = np.eye(N)
            add(J, -self.e[k], self.w[k] * np.linalg.inv(self.Q[k]))
        for i, k in enumerate(self.node):
            if k >= last or (k == last - 1 and not own):
                continue
            m = self.m[i]
            J = np.zeros((m, last * N))
            J[:, k * N : (k + 1) * N] = self.H[i, :m]
            add(J, self.r[i, :m], self.v[i] * np.linalg.inv(self.R[i, :m, :m]))
        if damping is not None:
            A += np.diag(damping)
        return A, b


def covariance(rng: np.random.Generator, n: int) -> np.ndarray:
    a = rng.normal(size=(n, n))
    return a @ a.T + 0.1 * np.eye(n)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_solution_of_the_normal_equations(seed: int):
    p = Problem(seed)
    (size, older), (_, _, filtered, _, step) = p.solve()
    A, b = p.dense()
    np.testing.assert_allclose(step.ravel(), np.linalg.solve(A, b), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(filtered[-1], np.linalg.inv(A)[-N:, -N:], rtol=1e-9)
    sigma = np.sqrt(np.diagonal(filtered, axis1=1, axis2=2))
    assert size == pytest.approx(np.max(np.abs(step) / sigma))
    assert older == 0.0


@pytest.mark.parametrize("node", range(1, COUNT))
def test_what_is_predicted_is_the_schur_complement_of_all_older_nodes(node: int):
    """Marginalising them out of the dense system leaves this prior."""
    p = Problem(4)
    _, (predicted, predicted_shift, _, _, _) = p.solve()
    A, b = p.dense(node + 1, own=False)
    old, new = slice(0, node * N), slice(node * N, None)
    schur = A[new, new] - A[new, old] @ np.linalg.solve(A[old, old], A[old, new])
    rest = b[new] - A[new, old] @ np.linalg.solve(A[old, old], b[old])
    np.testing.assert_allclose(np.linalg.inv(predicted[node]), schur, rtol=1e-7)
    np.testing.assert_allclose(predicted_shift[node], np.linalg.solve(schur, rest), rtol=1e-7)


def test_measurements_of_one_instrument_on_one_node_are_their_mean():
    """With one Jacobian and proportional noise nothing is lost; others on the node do not mix in."""
    p = Problem(1)
    order = [0, 0, 1, 0, 2, 3, 4, 5, 6]
    for name in ("node", "m", "H", "r", "R", "v"):
        setattr(p, name, np.ascontiguousarray(getattr(p, name)[order]))
    p.instrument = np.array(order)
    rng = np.random.default_rng(2)
    p.r, p.v = rng.normal(size=p.r.shape), rng.uniform(0.2, 1.0, len(order))
    p.R[1] *= 3.0
    p.v[3] = 0.0  # counts for nothing
    size, merged = p.solve()
    assert p.left[-1].tolist() == [1, 0, 1, 0, 1, 1, 1, 1, 1]
    p.instrument = np.arange(len(order))
    alone, single = p.solve()
    np.testing.assert_allclose(size, alone, rtol=1e-9)
    for ours, theirs in zip(merged, single, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-10)


def test_damping_is_levenberg_and_marquardts():
    p, damping = Problem(5), 0.7
    _, (predicted, _, filtered, _, step) = p.solve(damping)
    scale = damping / np.diagonal(predicted, axis1=1, axis2=2).ravel()
    A, b = p.dense(damping=scale)
    np.testing.assert_allclose(step.ravel(), np.linalg.solve(A, b), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(filtered[-1], np.linalg.inv(A)[-N:, -N:], rtol=1e-9)
    _, (*_, free) = p.solve()
    assert np.linalg.norm(step) < np.linalg.norm(free)


@pytest.mark.parametrize("first", [1, 3, 4])
def test_older_nodes_need_not_be_eliminated_again(first: int):
    """With other factors from a node on, it is enough to go on from what the nodes before it left."""
    p, rng = Problem(8), np.random.default_rng(9)
    p.solve()
    left, aid = p.left, int(np.searchsorted(p.node, first))
    p.r[aid:] = rng.normal(size=p.r[aid:].shape)
    p.v[aid:] *= 0.5
    p.e[first - 1 :] = rng.normal(size=p.e[first - 1 :].shape)
    (size, _), whole = p.solve()
    (same, older), part = p.solve(first=first, left=left)
    assert same == size
    sigma = np.sqrt(np.diagonal(whole[2], axis1=1, axis2=2))
    assert older == pytest.approx(np.max(np.abs(whole[-1][:first]) / sigma[:first]))
    for ours, theirs in zip(part, whole):
        np.testing.assert_array_equal(ours, theirs)


def test_rows_before_and_after_do_not_count():
    """Arrays that hold more rows than those of the chain give the same step, and keep the others."""
    p = Problem(11)
    size, alone = p.solve()
    nodes, motions, aids = (
        [np.concatenate([np.full_like(x[:2], 7), x, np.full_like(x[:1], 7)]) for x in arrays]
        for arrays in (alone, (p.F, p.Q, p.e, p.w), (p.node, p.instrument, p.m, p.H, p.r, p.R, p.v))
    )
    left = [np.concatenate([np.full_like(x[:2], 7), x, np.full_like(x[:1], 7)]) for x in p.left[4:]]
    for column in left[:3]:
        column[2:-1] = np.nan  # as `Problem.solve` begins
    for column in nodes:
        column[2:-1] = 0.0
    again = solve_chain(
        (p.prior, p.shift), (2, COUNT, 2, 2, len(p.node), 0), tuple(motions), tuple(aids), 0.0, 0, tuple(nodes[:4]),
        tuple(left), (nodes[4], np.empty(COUNT + 3)),
    )  # fmt: skip
    assert again == size
    for ours, theirs in zip((*nodes, *left), (*alone, *p.left[4:])):
        np.testing.assert_array_equal(ours[2:-1], theirs)
        assert np.all(ours[:2] == 7)
        assert np.all(ours[-1] == 7)


def test_after_a_step_there_is_none_to_take():
    """Residuals and prior moved as the step supposes: what is linear is solved."""
    p = Problem(10)
    _, (_, predicted_shift, _, filtered_shift, step) = p.solve()
    left = p.left
    motion, aids = (np.empty((COUNT - 1, N)), np.empty(COUNT - 1)), (np.empty_like(p.r), np.empty(len(p.node)))
    unit, one = np.tile(np.eye(N), (COUNT - 1, 1, 1)), np.tile(np.eye(3), (len(p.node), 1, 1))
    p.shift -= step[0]
    prior = np.empty((N, N))
    whitening(p.prior, prior)
    cost = after_step(
        p.rows, (prior, p.shift), (step, predicted_shift, filtered_shift), (p.F, p.e, unit, *motion, p.w),
        (p.node + 7, p.H, p.r, one, *aids, p.v),
    )  # fmt: skip
    assert cost == half_squares(p.rows, (prior, p.shift), (motion[1], p.w), (aids[1], p.v))
    assert np.abs(step).max() > 0.1
    for first in (0, 3, COUNT):  # whatever is eliminated anew
        _, (*_, after) = p.solve(first=first, left=left)
        np.testing.assert_allclose(after, 0.0, atol=1e-9)
    for error, (white, norm) in ((p.e, motion), (p.r, aids)):
        np.testing.assert_array_equal(white, error)
        np.testing.assert_allclose(norm, np.linalg.norm(error, axis=1))


def test_a_factor_without_weight_counts_for_nothing():
    p = Problem(6)
    p.v[3] = 0.0
    _, (*_, step) = p.solve()
    p.m[3], p.v[3] = 0, 1.0
    _, (*_, same) = p.solve()
    np.testing.assert_array_equal(step, same)


def test_states_without_noise_are_solved_for_too():
    """Constants, and a process noise twelve orders of magnitude below the covariance, as between two IMU samples."""
    p = Problem(7)
    p.Q[:] *= 1e-12
    p.Q[:, 2] = p.Q[:, :, 2] = 0.0
    p.F[:, 2] = np.eye(N)[2]
    p.e[:, 2] = 0.0
    _, (*_, step) = p.solve()
    np.testing.assert_allclose(step[:, 2], step[0, 2], rtol=1e-9)
    # The limit of no noise at all: everything is a function of the first node.
    map_, shift = np.eye(N), np.zeros(N)
    A, b = np.linalg.inv(p.prior), np.linalg.solve(p.prior, p.shift)
    for k in range(COUNT):
        if k:
            map_, shift = p.F[k - 1] @ map_, p.F[k - 1] @ shift - p.e[k - 1]
        for i in np.flatnonzero(p.node == k):
            m = p.m[i]
            J, W = p.H[i, :m] @ map_, p.v[i] * np.linalg.inv(p.R[i, :m, :m])
            A, b = A + J.T @ W @ J, b + J.T @ W @ (p.r[i, :m] - p.H[i, :m] @ shift)
    np.testing.assert_allclose(step[0], np.linalg.solve(A, b), rtol=1e-6)


def test_a_whitener_is_the_inverse_cholesky_factor():
    rng = np.random.default_rng(1)
    P, W = covariance(rng, 4), np.empty((4, 4))
    whitening(P, W)
    np.testing.assert_allclose(W, np.linalg.inv(np.linalg.cholesky(P)), rtol=1e-9, atol=1e-12)
    P[2] = P[:, 2] = 0.0
    whitening(P, W)
    assert not W[2].any()
    assert not W[:, 2].any()
    rest = [0, 1, 3]
    np.testing.assert_allclose(
        W[np.ix_(rest, rest)], np.linalg.inv(np.linalg.cholesky(P[np.ix_(rest, rest)])), rtol=1e-9, atol=1e-12
    )


def test_whitened_errors_have_the_norm_of_the_cost():
    rng = np.random.default_rng(2)
    e = rng.normal(size=(3, 4))
    P = np.array([covariance(rng, 4) for _ in range(3)])
    W, white, norm = np.empty_like(P), np.zeros_like(e), np.zeros(3)
    for p, w in zip(P, W):
        whitening(p, w)
    whiten(1, e, W, white, norm)
    assert norm[0] == 0.0  # before the row to begin with
    whiten(0, e, W, white, norm)
    np.testing.assert_allclose(norm**2, [x @ np.linalg.solve(p, x) for x, p in zip(e, P)])
    np.testing.assert_allclose(np.linalg.norm(white, axis=1), norm)


def test_the_cost_is_half_the_weighted_sum_of_squares():
    rng = np.random.default_rng(3)
    P, shift = covariance(rng, 4), rng.normal(size=4)
    W = np.empty((4, 4))
    whitening(P, W)
    norm, weight = rng.uniform(size=(2, 3))
    aid_norm, aid_weight = rng.uniform(size=(2, 5))
    squares = shift @ np.linalg.solve(P, shift) + weight @ norm**2 + aid_weight @ aid_norm**2
    around = [np.concatenate([[9.0], x, [9.0]]) for x in (norm, weight, aid_norm, aid_weight)]
    cost = half_squares((1, 4, 1, 1, 5, 0), (W, shift), (around[0], around[1]), (around[2], around[3]))
    assert cost == pytest.approx(0.5 * squares)  # rows before and after do not count


@pytest.mark.parametrize(
    ("motion", "aid", "first"), [(None, None, 4), (None, 2, 1), (0, None, 1), (2, 2, 1), (1, 4, 2), (None, 4, 3)]
)
def test_weights_that_have_hardly_changed_are_kept(motion: int | None, aid: int | None, first: int):
    """A motion's weight has to do with the node that it leads to, a measurement's with its own."""
    node = np.array([0, 1, 1, 2, 3], dtype=np.int64)
    before, aid_before = np.array([1.0, 0.5, 0.2]), np.array([1.0, 1.0, 0.6, 0.3, 1e-3])
    norm, aid_norm = np.array([0.1, 2.0, 0.0]), np.array([0.0, 1.0, 3.0, 0.5, 40.0])
    weight, aid_weight = before + 0.009 / np.maximum(norm, 1.0), aid_before - 0.009 / np.maximum(aid_norm, 1.0)
    changed = []
    for weights, norms, which in ((weight, norm, motion), (aid_weight, aid_norm, aid)):
        if which is not None:
            weights[which] += 0.03 / max(norms[which], 1.0)
            changed.append((weights, which, weights[which]))
    assert keep_weights((before, norm, weight), node + 7, 7, (aid_before, aid_norm, aid_weight), 0.01) == first
    for weights, which, wanted in changed:
        assert weights[which] == wanted
    kept = [np.delete(w, [] if i is None else i) for w, i in ((weight, motion), (aid_weight, aid))]
    were = [np.delete(w, [] if i is None else i) for w, i in ((before, motion), (aid_before, aid))]
    for ours, theirs in zip(kept, were):
        np.testing.assert_array_equal(ours, theirs)
