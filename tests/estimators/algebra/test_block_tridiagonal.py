"""One step of a chain of nodes against the dense normal equations."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimators.algebra.block_tridiagonal import after_step, half_squares, keep_weights, solve_chain, whiten
from simnav.estimators.algebra.factors import AidingFactors, Motions, Nodes, Prior, Rows, Window
from simnav.estimators.algebra.whitening import whitening

N, COUNT, BASE = 5, 6, 7
#: Shapes of the entries of a column, with n states; the others are numbers.
VECTORS = ("predicted_shift", "filtered_shift", "step", "begin_shift", "end_shift", "residual", "whitened")
MATRICES = ("predicted", "filtered", "transition", "noise", "whitener", "jacobian")
OF_THREE = {"value": (3,), "innovation": (3,), "residual": (3,), "whitened": (3,), "noise": (3, 3), "whitener": (3, 3)}


def columns(kind: type, rows: int, n: int = N, **known: np.ndarray):
    """A record of a window with so many rows, NaN where nothing is known."""
    shapes = dict.fromkeys(VECTORS, (n,)) | dict.fromkeys(MATRICES, (n, n))
    if kind is AidingFactors:
        shapes = OF_THREE | dict.fromkeys(("jacobian", "cross", "white"), (3, n))
    whole = ("node", "between", "instrument", "components", "bare", "used") if kind is AidingFactors else ()
    made = {name: np.full((rows, *shapes.get(name, ())), np.nan) for name in kind.numba_fields if name not in whole}
    made |= {name: np.zeros(rows, np.int64) for name in whole}
    return kind(**(made | {name: np.ascontiguousarray(array) for name, array in known.items()}))


def window_of(nodes: Nodes, motions: Motions, aids: AidingFactors, prior: Prior | None = None) -> Window:
    n = nodes.step.shape[1]
    return Window(
        nodes=nodes, motions=motions, aids=aids,
        prior=prior or Prior(covariance=np.eye(n), whitener=np.eye(n), shift=np.zeros(n)),
    )  # fmt: skip


def rows_of(nodes: int, aids: int, before: int = 0, coupled: int = N) -> Rows:
    """Where a window is in columns with so many rows before it."""
    return Rows(before, nodes, before, before, aids, 0, 0, BASE, 0, coupled)


def padded(record, before: int = 2, after: int = 1):
    """A record with further rows of sevens before and after."""
    kind = type(record)
    arrays = {name: getattr(record, name) for name in kind.numba_fields}
    return kind(**{
        name: np.concatenate([np.full_like(x[:before], 7), x, np.full_like(x[:after], 7)]) for name, x in arrays.items()
    })  # fmt: skip


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
    def window(self) -> Window:
        """The factors as they are, and nodes that nothing is known of."""
        aids = columns(
            AidingFactors, len(self.node), node=self.node + BASE, instrument=self.instrument, components=self.m,
            jacobian=self.H, residual=self.r, noise=self.R, weight=self.v,
        )  # fmt: skip
        motions = columns(Motions, COUNT - 1, jacobian=self.F, noise=self.Q, residual=self.e, weight=self.w)
        prior = Prior(covariance=self.prior, whitener=np.empty((N, N)), shift=self.shift)
        return window_of(columns(Nodes, COUNT), motions, aids, prior)

    def solve(self, damping: float = 0.0, first: int = 0, left: Window | None = None):
        """Largest step; predicted and filtered covariances and shifts, step.

        ``left`` is the window that solving left for the nodes before ``first``.
        """
        window = self.window
        if left is not None:
            for name in ("predicted", "predicted_shift", "filtered", "filtered_shift"):
                getattr(window.nodes, name)[:first] = getattr(left.nodes, name)[:first]
            older = int(np.searchsorted(self.node, first))
            for name in ("cross", "white", "innovation", "used"):
                getattr(window.aids, name)[:older] = getattr(left.aids, name)[:older]
        size = solve_chain(window, rows_of(COUNT, len(self.node)), self.prior, self.shift, damping, first)
        self.left, nodes = window, window.nodes
        return size, (nodes.predicted, nodes.predicted_shift, nodes.filtered, nodes.filtered_shift, nodes.step)

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
    assert p.left.aids.used.tolist() == [1, 0, 1, 0, 1, 1, 1, 1, 1]
    p.instrument = np.arange(len(order))
    alone, single = p.solve()
    np.testing.assert_allclose(size, alone, rtol=1e-9)
    for ours, theirs in zip(merged, single, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-10)


def test_the_weight_of_a_motion_does_not_loosen_the_errors_of_instruments():
    """From component ``coupled`` on the process noise is that of the weight 1, in the step and in the cost."""
    p, coupled = Problem(3), 3
    p.Q[:, coupled:, :coupled] = p.Q[:, :coupled, coupled:] = 0.0
    window, rows = p.window, rows_of(COUNT, len(p.node), coupled=coupled)
    solve_chain(window, rows, p.prior, p.shift, 0.0, 0)
    whitener = np.linalg.inv(np.linalg.cholesky(p.Q))
    whiten(0, window.motions.residual, whitener, window.motions.whitened, window.motions.norm)
    window.aids.norm[:], window.prior.whitener[:] = 0.0, 0.0
    cost = half_squares(window, rows)
    p.Q[:, :coupled, :coupled] /= p.w[:, None, None]
    p.w[:] = 1.0
    _, (*_, step) = p.solve()
    np.testing.assert_allclose(window.nodes.step, step, rtol=1e-9, atol=1e-12)
    assert cost == pytest.approx(0.5 * np.einsum("ki,kij,kj", p.e, np.linalg.inv(p.Q), p.e))


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
    """Columns that hold more rows than those of the window give the same step, and keep the others."""
    p = Problem(11)
    size, _ = p.solve()
    alone, fresh = p.left, p.window
    window = window_of(padded(fresh.nodes), padded(fresh.motions), padded(fresh.aids), fresh.prior)
    assert solve_chain(window, rows_of(COUNT, len(p.node), 2), p.prior, p.shift, 0.0, 0) == size
    for part in ("nodes", "aids"):
        ours, theirs = getattr(window, part), getattr(alone, part)
        for name in type(ours).numba_fields:
            column = getattr(ours, name)
            np.testing.assert_array_equal(column[2:-1], getattr(theirs, name))
            assert np.all(column[:2] == 7)
            assert np.all(column[-1] == 7)


def test_after_a_step_there_is_none_to_take():
    """Residuals and prior moved as the step supposes: what is linear is solved."""
    p = Problem(10)
    p.solve()
    w, rows = p.left, rows_of(COUNT, len(p.node))
    w.motions.whitener[:], w.aids.whitener[:] = np.eye(N), np.eye(3)
    w.prior.shift -= w.nodes.step[0]
    whitening(p.prior, w.prior.whitener)
    cost = after_step(w, rows)
    assert cost == half_squares(w, rows)
    assert np.abs(w.nodes.step).max() > 0.1
    for first in (0, 3, COUNT):  # whatever is eliminated anew
        solve_chain(w, rows, p.prior, p.shift, 0.0, first)
        np.testing.assert_allclose(w.nodes.step, 0.0, atol=1e-9)
    for factors in (w.motions, w.aids):
        np.testing.assert_array_equal(factors.whitened, factors.residual)
        np.testing.assert_allclose(factors.norm, np.linalg.norm(factors.residual, axis=1))


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
    motions = padded(columns(Motions, 3, 4, norm=norm, weight=weight), 1)
    aids = padded(columns(AidingFactors, 5, 4, norm=aid_norm, weight=aid_weight), 1)
    prior = Prior(covariance=P, whitener=W, shift=shift)
    cost = half_squares(window_of(columns(Nodes, 6, 4), motions, aids, prior), rows_of(4, 5, 1))
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
    motions = columns(Motions, 3, norm=norm, weight=weight)
    aids = columns(AidingFactors, 5, node=node + BASE, norm=aid_norm, weight=aid_weight)
    window = window_of(columns(Nodes, 4), motions, aids)
    assert keep_weights(window, rows_of(4, 5), before, aid_before, 0.01) == first
    for weights, which, wanted in changed:
        assert weights[which] == wanted
    kept = [np.delete(w, [] if i is None else i) for w, i in ((weight, motion), (aid_weight, aid))]
    were = [np.delete(w, [] if i is None else i) for w, i in ((before, motion), (aid_before, aid))]
    for ours, theirs in zip(kept, were):
        np.testing.assert_array_equal(ours, theirs)
