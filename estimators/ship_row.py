"""What rows over the ship model share: its parameters, and what they need of the instruments."""

from __future__ import annotations

from math import radians
from typing import Any, ClassVar

from simnav.estimator import Estimator
from simnav.estimators.models.ship import ShipModel, require_ship_aids
from simnav.types import InitialState, Instruments

__all__ = ["ShipRow"]


class ShipRow(Estimator):
    """An estimator for a ship without an INS; put it before the solver's class::

        class ShipEkf(ShipRow, KalmanEstimator): ...

    Parameters
    ----------
    acceleration : float
        Noise density of the speed [m/s/sqrt(s)].
    turn_rate_deg, turn_time : float
        Sigma [deg/s] and correlation time [s] of the turn rate.
    current, current_time : float
        Sigma of each component of the current [m/s], and its correlation time [s].
    sway : float
        Sigma of the sideways velocity through the water [m/s].
    **solver
        What the solver takes beside the model.
    """

    model_class: ClassVar[type[ShipModel]] = ShipModel

    def __init__(
        self,
        *,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
        **solver: Any,
    ):
        model = self.model_class(acceleration, radians(turn_rate_deg), turn_time, current, current_time, sway)
        super().__init__(self._given(model), **solver)  # type: ignore[call-arg]  # the solver's

    def _given(self, model: ShipModel) -> Any:
        """What the solver is given: the model, or a chain of it."""
        return model

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs a heading, and a position or a speed."""
        require_ship_aids(instruments, self.name)
        super().reset(start, instruments)  # type: ignore[safe-super]  # likewise
