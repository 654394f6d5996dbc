"""The base of rows with a network: what they learned from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from simnav.estimators.composition import Row
from simnav.estimators.networks.file import Network

__all__ = ["NetworkRow"]


class NetworkRow(Row):
    """A row with a network in its adaptation or weighting, or for the velocity."""

    @property
    def network(self) -> Network:
        """The network."""
        own = vars(self.solver)
        piece: Any = next(own[name] for name in ("adaptation", "weighting", "velocity") if own.get(name) is not None)
        found: Network = piece.network
        return found

    @property
    def learned_from(self) -> Sequence[tuple[int, int]]:
        """The training voyages, as the file tells them."""
        return self.network.learned_from

    @property
    def trained_on(self) -> Mapping[str, Any]:
        """The record of the training, with the size of the network, for a board."""
        return {**self.network.trained_on, "parameters": self.network.parameters}
