"""The true values of a block of states in one run (`simnav.blocks`), and the check of what a kind declares.

The process is drawn at the nodes of a grid of its own, and is linear between them. So its value at a time depends on
the seed and the name of the block only: two instruments that share a block see the same value at the same time, at
whatever rates they sample it, and a run in many blocks gives the same numbers as a run in one.
"""

from __future__ import annotations

from typing import Protocol, Self

import numpy as np

from simnav.blocks import LEVER_ARM, StateBlock
from simnav.kinds import Kind
from simnav.spec import SpecError
from simnav.streams import stream
from simnav.types import Array

__all__ = ["BlockValues", "check_blocks"]

#: Step of the grid [s]; that of a Gauss-Markov process is at most this part of its correlation time.
STEP, PART = 1.0, 0.05


class Declares(Protocol):
    """A specification that declares blocks of states."""

    @property
    def definition(self) -> Kind:
        """Properties of its kind."""
        ...

    def blocks(self) -> tuple[StateBlock, ...]:
        """The states that it brings along."""
        ...

    def ideal(self) -> Self:
        """The same specification without errors."""
        ...


class BlockValues:
    """The values of a block in one run.

    Parameters
    ----------
    block : StateBlock
        The block, with its true figures.
    label : str
        Its name among all blocks of the run; its random stream is named after it.
    seed : int
        Seed of the run.
    """

    def __init__(self, block: StateBlock, label: str, seed: int):
        self.block = block
        self._step = min(STEP, PART * block.correlation_time) if block.process == "gauss_markov" else STEP
        self._rng = stream(seed, "block", label)
        first = np.asarray(block.sigma) * self._rng.standard_normal(block.size)
        self._nodes = first[None]
        self._moves = block.process != "constant" and block.varies
        if self._moves:
            self._transition = block.transition(self._step)
            values, vectors = np.linalg.eigh(block.noise(self._step))
            self._root = vectors * np.sqrt(np.maximum(values, 0.0))

    def at(self, time: Array) -> Array:
        """The values at n times.

        Parameters
        ----------
        time : (n,) array
            Times [s]; before 0 the value is that at 0.

        Returns
        -------
        (n, k) array
            SI units and radians.
        """
        time = np.maximum(np.asarray(time, dtype=np.float64), 0.0)
        if not self._moves or not len(time):
            return self._nodes[:1].repeat(len(time), axis=0)
        place = time / self._step
        index = place.astype(np.intp)
        self._extend(int(index.max()) + 2)
        share = (place - index)[:, None]
        before, after = self._nodes[index], self._nodes[index + 1]
        return np.asarray(before + share * (after - before))

    def _extend(self, count: int) -> None:
        """Draw the process up to a number of nodes."""
        missing = count - len(self._nodes)
        if missing <= 0:
            return
        more, last = np.empty((missing, self.block.size)), self._nodes[-1]
        for k in range(missing):
            last = self._transition @ last + self._root @ self._rng.standard_normal(self.block.size)
            more[k] = last
        self._nodes = np.concatenate([self._nodes, more])


def check_blocks(spec: Declares, source: str) -> None:
    """Check the blocks of an example: an observation uses them, and an ideal instrument has none of their errors.

    Raises
    ------
    SpecError
        If they are not valid. The message begins with ``source``.
    """
    try:
        blocks = spec.blocks()
    except ValueError as error:
        raise SpecError(f"{source}: {error}") from None
    if any(block.name != LEVER_ARM for block in blocks) and spec.definition.observation is None:
        raise SpecError(f"{source} brings blocks of states; its equation should be a function that uses them")
    fields = [field for field in vars(spec) if field.startswith("bias")]
    if fields and any(block.name == "bias" for block in blocks):
        raise SpecError(
            f"{source}: its block of states 'bias' has the name of the error of its field {fields[0]!r}, for which "
            "estimators have states, too; give the block another name"
        )
    for block in spec.ideal().blocks():
        if block.varies:
            raise SpecError(
                f"{source}: an ideal instrument still has sigma = {block.sigma} and density = {block.density} of its "
                f"block {block.name!r}; {type(spec).__qualname__}.errors should name the fields that they come from"
            )
