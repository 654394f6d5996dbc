"""An estimator that takes part in a campaign, resolved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from simnav.estimator import find, make
from simnav.estimator.registry import discover_point

from .request import enlist, file_of
from .session_class import receive

if TYPE_CHECKING:
    from simnav.estimator import Estimator
    from simnav.estimator.needs import Needs

__all__ = ["Entrant"]


@dataclass(frozen=True)
class Entrant:
    """An estimator that takes part: it can be imported in any folder, and is known by its sources.

    Attributes
    ----------
    name, parameters, label, search
        As of `EstimatorRequest`; a file is named by its absolute path.
    reference : bool
        Whether it is one of simnav's references, which receive the truth.
    source : str
        Digest of the source of the estimator.
    version : int
        Declared version of the estimator.
    own : str
        Digest of the user's own code alone; empty for an estimator that comes with simnav.
    needs : tuple
        As of `simnav.estimator.Estimator`; of an estimator of others, and empty where it does not tell them.
    kernels : tuple of str
        Modules of simnav whose kernels it may call, which are then loaded before it begins; ``simnav``: all.
    code : bytes
        The class itself, where no other process can import it.
    point : str
        Entry point of another package that registers it; empty where there is none.
    learned_from : tuple of pairs of int
        As of `simnav.estimator.Estimator`.
    learned : mapping
        What results say of the training (`simnav.leaderboard.campaign.training_runs.record_of`).
    """

    name: str
    parameters: Mapping[str, Any]
    label: str
    reference: bool
    source: str
    code: bytes = b""
    point: str = ""
    search: tuple[str, ...] = ()
    learned_from: tuple[tuple[int, int], ...] = ()
    learned: Mapping[str, Any] = field(default_factory=dict)
    version: int = 1
    own: str = ""
    needs: Needs = ()
    kernels: tuple[str, ...] = ("simnav",)

    @property
    def ours(self) -> bool:
        """Whether it comes with simnav, so that it is trusted not to look ahead in what it is handed."""
        return not (self.own or self.code or self.point or file_of(self.name))

    def find(self) -> type[Estimator]:
        """Its class, in the process in which it is run."""
        discover_point(self.point)
        if self.code:
            enlist(receive(self.code))
        return find(self.name)

    def make(self) -> Estimator:
        """An instance, likewise."""
        self.find()
        return make(self.name, **self.parameters)
