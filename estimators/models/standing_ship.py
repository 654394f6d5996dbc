"""The ship model of a filter that does not use dead reckoning: without a fix the ship stands still.

Jiang et al. (2026) print errors of 200 to 500 m at the end of outages of 60 s for their EKF and UKF, on ships of
6.5 m/s with compass and log. A filter that stays where the last fix was is off by the distance that the ship makes,
390 m. This model is that filter, for comparison. It is one reading of the printed figures, and not what the authors
say they did.
"""

from __future__ import annotations

from simnav.compiled import kernel
from simnav.kernel_types import Matrix, Vector
from simnav.structures import filled
from simnav.types import Array, InitialState, Instruments

from .filtering import Dynamics, Prediction, Readings
from .propagation import Samples
from .ship import ShipModel
from .ship_functions import SHIP_FUNCTIONS, SHIP_MOTION, ship_state
from .ship_functions import predict as predict_ship
from .ship_functions import propagate as propagate_ship
from .ship_kernels import POSITION, SHIP

__all__ = ["StandingShip"]


@kernel
def stand(
    position: Vector, place: Vector, covariance: Matrix, speed: float, constants: Vector, begin: float, until: float
) -> None:
    """Bring a ship back to where it was, if it has had no fix for a time; its position gets uncertain by its way.

    Parameters
    ----------
    position, place : (3,) arrays
        Where the ship is at the end of a time, overwritten, and where it was at its beginning.
    covariance : (n, n) array
        Covariance of the errors; updated.
    speed : float
        Through the water [m/s].
    constants : array
        A `SHIP_MOTION`.
    begin, until : float
        The time [s].
    """
    motion = constants.view(SHIP_MOTION)[0]
    if until <= max(begin, motion.last_fix + motion.patience):
        return
    for i in range(3):
        position[i] = place[i]
    waited, waited_before = until - motion.last_fix, begin - motion.last_fix
    grown = speed**2 * (waited**2 - waited_before**2)
    covariance[SHIP.north, SHIP.north] += grown
    covariance[SHIP.east, SHIP.east] += grown


@kernel(passed=True)
def propagate(dynamics: Dynamics, samples: Samples, until: float) -> None:
    """Advance the state and its covariance to a time."""
    state = ship_state(dynamics.numbers)
    begin, place = state.clock[0], state.position.copy()
    if until > begin:
        propagate_ship(dynamics, samples, until)
        stand(state.position, place, dynamics.covariance, state.x[SHIP.speed], dynamics.constants, begin, until)


@kernel(passed=True)
def predict(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Predict a reading; a fix ends the standing."""
    if dynamics.aids.code[readings.instrument[k]] == POSITION:
        dynamics.constants.view(SHIP_MOTION)[0].last_fix = readings.time[k]
    return predict_ship(dynamics, readings, k, prediction)


class StandingShip(ShipModel):
    """`ShipModel` whose position stays where it is while there are no fixes.

    The variance of the position then grows as if the speed were its error, so that the next fix is used.

    Parameters
    ----------
    patience : float
        Time without a fix after which the position stays where it is [s].
    """

    memory = ("constants",)
    equations = SHIP_FUNCTIONS._replace(propagate=propagate, predict=predict)

    def __init__(self, patience: float = 1.5):
        if not patience > 0.0:
            raise ValueError(f"patience is {patience:g}; it must be a time above 0 s")
        super().__init__()
        self.patience = patience

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario if there is nothing that gives a speed and a heading."""
        covariance = super().begin(start, instruments)
        self.constants = filled(SHIP_MOTION, turn_time=self.turn_time, patience=self.patience, last_fix=start.time)
        return covariance
