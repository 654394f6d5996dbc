"""The rows of the ANFIS: a reconstruction of paper 002's ANFIS-FGO, and the same adaptation in a filter."""

from __future__ import annotations

from typing import Any

from simnav.estimator import register
from simnav.estimators.adaptations.anfis import Anfis
from simnav.estimators.adaptations.anfis_file import FeatureSet
from simnav.estimators.ship_ekf import ShipEkf
from simnav.estimators.ship_graphs import ShipFgo
from simnav.estimators.ship_row import ShipRow

__all__ = ["AnfisEkf", "AnfisFgo", "AnfisFgoMotion"]


class _AnfisRow(ShipRow):
    """A ship's row whose noise the network chooses.

    Parameters
    ----------
    features, file, lowest, highest
        As for ``anfis-fgo``.
    **options
        Of the model and the solver.
    """

    def __init__(
        self,
        features: FeatureSet = "innovation",
        file: str = "",
        lowest: float = 1.0,
        highest: float = 30.0,
        **options: Any,
    ):
        super().__init__(adaptation=Anfis(features, file, lowest, highest), **options)


@register("anfis-fgo")
class AnfisFgo(_AnfisRow, ShipFgo):
    """ANFIS-FGO, a reconstruction: ``ship-fgo``, the noise of each fix chosen by a neuro-fuzzy network.

    After paper 002, whose section on the network is missing from the text at hand; see docs/anfis.md. Needs what
    ``ship-fgo`` needs.

    Parameters
    ----------
    features : "innovation", "motion" or "recent"
        Inputs of the network: the whitened innovation beside turn rate and change of speed; motion only; or the
        innovation beside those before it.
    file : str
        Parameter file that `simnav train anfis` wrote; empty for the one that comes with the package.
    lowest, highest : float
        Bounds of the sigma in units of the datasheet's.
    window, tolerance, iterations, acceleration, turn_rate_deg, turn_time, current, current_time, sway
        As for ``ship-fgo``.
    """


@register("anfis-fgo-motion")
class AnfisFgoMotion(AnfisFgo):
    """ANFIS-FGO, a reconstruction, with a network that sees the ship's motion only: ``anfis-fgo`` but for that.

    The ablation of ``anfis-fgo``. In our simulations GNSS noise knows nothing of the ship's motion, so that this
    network can learn no more than the mean.
    """

    def __init__(self, file: str = "", lowest: float = 1.0, highest: float = 30.0, **options: Any):
        super().__init__("motion", file, lowest, highest, **options)


@register("anfis-ekf")
class AnfisEkf(_AnfisRow, ShipEkf):
    """The network of ``anfis-fgo`` (a reconstruction of paper 002) in ``ship-ekf``: what it does without the graph.

    Parameters
    ----------
    features, file, lowest, highest
        As for ``anfis-fgo``.
    acceleration, turn_rate_deg, turn_time, current, current_time, sway
        As for ``ship-ekf``.
    """
