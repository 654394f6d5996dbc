"""The chain of a model that can move any of its states again: a motion factor is the motion of the older node itself.

No preintegration is needed: the motion of a node is computed anew wherever the node is, so a motion factor is exact for
any shift. Its noise is that of the propagation of the front. The chain is written once, for models in plain NumPy
(`simnav.estimators.models.general`) and for compiled ones (`simnav.estimators.models.ship`); a model says how several
of its states move, what they differ by and what a step makes of them. Only the readings are a matter of a subclass.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.block_tridiagonal import error_after_step
from simnav.kernel_types import Matrix, Stack
from simnav.types import Array

from .base import ErrorModel
from .chain import Chain
from .intermediate_states import add_motion_noise, through_motion

__all__ = ["MovingChain", "MovingModel"]

#: K states of a model: an array (K, ...) for each name in `ErrorModel.state`, in that order.
States = tuple[Array, ...]


@kernel
def _errors_after_step(residual: Matrix, jacobian: Stack, step: Matrix, after: Matrix) -> None:
    """The errors of K motions that a (K + 1, n) step of the nodes leaves, into a (K, n) array."""
    for k in range(residual.shape[0]):
        error_after_step(residual[k], jacobian[k], step[k], step[k + 1], after[k])


class MovingModel(ErrorModel):
    """A model whose motion depends on the state and the time alone, so that any of its states can be moved again."""

    @abstractmethod
    def move_all(self, states: States, elapsed: Array, jacobian: Array | None = None) -> None:
        """Move K states, each by a time of its own, in place.

        Parameters
        ----------
        states : tuple of (K, ...) array
            The states; updated.
        elapsed : (K,) array
            Times [s].
        jacobian : (K, n, n) array, optional
            Overwritten with the derivative of each state's error at the end by that at the start.
        """

    @abstractmethod
    def difference_all(self, states: States, others: States) -> Array:
        """(K, n) errors that lead from K other states to these."""

    @abstractmethod
    def retract_all(self, states: States, steps: Array) -> None:
        """Add (K, n) errors to K states, in place."""


class MovingChain(Chain):
    """The chain of the module.

    Parameters
    ----------
    front : MovingModel
        The model that runs ahead and leaves the nodes behind.
    """

    front: MovingModel

    def _nodes(self) -> States:
        """Views of the states of all nodes."""
        return tuple([self.nodes[name] for name in self.front.state])

    def linearise_motion(self, node: int = 0) -> None:
        """As `Chain.linearise_motion`."""
        first = max(node - 1, 0)
        time, motions, states = self.nodes["time"], self.motions, self._nodes()
        moved = tuple([each[first:-1].copy() for each in states])
        self.front.move_all(moved, time[first + 1 :] - time[first:-1], motions["jacobian"][first:])
        newer = tuple([each[first + 1 :] for each in states])
        motions["residual"][first:] = self.front.difference_all(newer, moved)

    def linearise_aids(self, node: int = 0) -> None:
        """As `Chain.linearise_aids`."""
        aids, between, first = self.aids, self.between, self.first_aid(node)
        jacobian, later = aids["jacobian"], len(between) > 0 and first < len(aids)
        if later:
            self.move_intermediate(int(between["node"].searchsorted(aids["node"][first])))
        places = self.places(first)
        for row, states, prefix in places:
            self.observe(first, row, states, prefix, jacobian)
        if later:
            row, _, _ = places[-1]
            add_motion_noise.unchecked(
                first, row, aids["components"], jacobian, between["noise"], aids["noise"], aids["whitener"],
                aids["bare"],
            )  # fmt: skip
            through_motion.unchecked(first, row, min(self.coupled, self.size), between["jacobian"], jacobian)

    def move_intermediate(self, first: int) -> None:
        """Compute ``now_...`` and ``jacobian`` of the intermediate states from an index on, at the present nodes."""
        nodes, between = self.nodes, self.between
        row = between["node"][first:] - self.base
        now = tuple([between[f"now_{name}"][first:] for name in self.front.state])
        for states, name in zip(now, self.front.state, strict=True):
            states[...] = nodes[name][row]
        self.front.move_all(now, between["time"][first:] - nodes["time"][row], between["jacobian"][first:])

    def retract(self, step: Array) -> None:
        """As `Chain.retract`; the motion factors need no shifts."""
        self.front.retract_all(self._nodes(), step)
        self.prior.shift[:] = self.relative_shift(self.prior.shift, step[0])

    def along_motion(self, step: Array) -> Array:
        """As `Chain.along_motion`."""
        front, time, motions, states = self.front, self.nodes["time"], self.motions, self._nodes()
        along, after = np.empty_like(step), np.empty_like(motions["residual"])
        _errors_after_step(motions["residual"], motions["jacobian"], step, after)
        along[0] = step[0]
        for k in range(len(motions)):
            moved = tuple([each[k : k + 1].copy() for each in states])
            front.retract_all(moved, along[k : k + 1])
            front.move_all(moved, time[k + 1 : k + 2] - time[k : k + 1])
            newer = tuple([each[k + 1 : k + 2] for each in states])
            along[k + 1] = after[k] + front.difference_all(moved, newer)[0]
        return along
