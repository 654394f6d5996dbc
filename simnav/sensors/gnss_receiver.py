"""A receiver that solves the raw observations of `simnav.sensors.gnss_raw`: position, and velocity by Doppler.

It takes the readings of the instrument ``observations``, with all their faults, subtracts the modelled delays, and
solves them by weighted least squares with RAIM and exclusion (`simnav.satellites.point_solution`). The weights follow
from the datasheet of that instrument: white noise, lasting error of the satellite, errors of the models of the delays.
There is no reading with fewer than four satellites, with a position dilution of precision of 30 or more, or if RAIM
finds a fault that it cannot exclude. The faults of a reading are those of the observations that were used; its
``fault_error`` is the difference from the solution of the same satellites without them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from pydantic import Field

from simnav import kinds
from simnav.compiled import ready
from simnav.kinds import Kind, geodetic_components, speed_components
from simnav.recording import AidStream
from simnav.satellites.point_solution import PointSolution, Ranges, monitored, solve
from simnav.satellites.signal_errors import amplification, noise_factor, range_error
from simnav.sensors.derived import DerivedInstrument
from simnav.sensors.gnss_observation import SEEN
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, SigmaTriple, register_instrument
from simnav.spec import Vector, quantity
from simnav.types import Array, Datasheet

__all__ = ["GnssReceiver", "GnssReceiverVelocity", "corrected_ranges"]

#: Times closer than this are one and the same [s].
_SAME = 1e-6
#: Where a datasheet says that observations have no error: the sigmas of the weights, range [m] and rate [m/s].
_LEAST_SIGMA = (1e-3, 1e-4)


class _ReceiverSpec(AidSpec):
    """What both kinds have in common.

    Attributes
    ----------
    observations : str
        Name of the instrument of kind ``gnss_raw`` whose observations it solves.
    false_alarm : float
        Probability of a false alarm of RAIM in each solution; 0 for no RAIM.
    """

    observations: str = "gnss_raw"
    false_alarm: float = Field(1e-5, ge=0.0, lt=0.5)

    def sources(self) -> Mapping[str, str]:
        """See `AidSpec.sources`."""
        return {self.observations: "gnss_raw"}


@register_instrument(
    Kind("position by satellites", "fix", geodetic_components(height=True), kinds.POSITION, geodetic=True),
    example={"sigma_m": [1.0, 1.0, 2.0], "lever_arm_m": [1.0, 0.0, -3.0]},
)
class GnssReceiver(_ReceiverSpec):
    """Position of the antenna, solved from the raw observations of another instrument.

    Attributes
    ----------
    sigma, bias_instability, correlation_time
        What the datasheet says about the error of the position; the error itself comes from the observations.
    """

    kind: Literal["gnss_receiver"] = "gnss_receiver"
    sigma: SigmaTriple = quantity("m")
    bias_instability: SigmaTriple = quantity("m", ZERO)
    lever_arm: Vector = quantity("m", ZERO)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Position(self, name, seed)


@register_instrument(
    Kind(
        "velocity by satellites",
        "velocity",
        speed_components("velocity_north", "velocity_east", "velocity_down"),
        kinds.VELOCITY,
    ),
    example={"sigma_m_s": 0.05, "lever_arm_m": [1.0, 0.0, -3.0]},
)
class GnssReceiverVelocity(_ReceiverSpec):
    """Velocity of the antenna by Doppler."""

    kind: Literal["gnss_receiver_velocity"] = "gnss_receiver_velocity"
    sigma: SigmaTriple = quantity("m_s")
    lever_arm: Vector = quantity("m", ZERO)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Velocity(self, name, seed)


class _Receiver(DerivedInstrument):
    """Parameters as of `Instrument`."""

    def __init__(self, spec: _ReceiverSpec, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec

    def answer(self, solution: PointSolution) -> tuple[Array, Array]:
        """The (3,) reading of a solution and its (3,) sigma."""
        raise NotImplementedError

    def derive(self, time: Array, streams: Mapping[str, AidStream], sheets: Mapping[str, Datasheet]) -> AidStream:
        """See `DerivedInstrument.derive`."""
        source, sheet = streams[self.spec.observations], sheets[self.spec.observations]
        first = np.searchsorted(source.time, time - _SAME)
        last = np.searchsorted(source.time, time + _SAME)
        kept, lost, rows = [], [], []
        for t, i, j in zip(time, first, last, strict=True):
            found = monitored(corrected_ranges(source, slice(i, j), sheet), self.spec.false_alarm)
            if found is None:
                lost.append(t)
                continue
            reading, spread = self.answer(found)
            kept.append(t)
            rows.append((reading, spread, *self._faults(source, slice(i, j), sheet, found, reading)))
        value, sigma, error = (np.array([row[k] for row in rows]).reshape(-1, 3) for k in (0, 1, 3))
        faults = np.array([row[2] for row in rows], dtype=np.uint32)
        return AidStream(self.name, self.kind, np.array(kept), value, faults, error, sigma, np.array(lost))

    def _faults(
        self, source: AidStream, rows: slice, sheet: Datasheet, found: PointSolution, value: Array
    ) -> tuple[int, Array]:
        """The faults of the observations that were used, and what they change."""
        faults = int(np.bitwise_or.reduce(source.faults[rows][found.used]))
        if not source.fault_error[rows][found.used].any():
            return faults, np.zeros(3)
        healthy = solve(corrected_ranges(source, rows, sheet, without_faults=True).only(found.used))
        return faults, np.zeros(3) if healthy is None else self.definition.difference(value, self.answer(healthy)[0])


class _Position(_Receiver):
    def answer(self, solution: PointSolution) -> tuple[Array, Array]:
        return solution.position, np.sqrt(np.diag(solution.covariance))


class _Velocity(_Receiver):
    def answer(self, solution: PointSolution) -> tuple[Array, Array]:
        return solution.velocity, np.sqrt(np.diag(solution.velocity_covariance))


def corrected_ranges(source: AidStream, rows: slice, sheet: Datasheet, *, without_faults: bool = False) -> Ranges:
    """The corrected observations of one epoch, with sigmas by the datasheet.

    Parameters
    ----------
    source : AidStream
        Of an instrument of the kind ``gnss_raw``.
    rows : slice
        Its readings of one time.
    sheet : Datasheet
        Its datasheet.
    without_faults : bool
        Whether the errors of faults are taken away.
    """
    value, side = source.value[rows], source.side[rows]
    if without_faults:
        value = value - source.fault_error[rows]
    frequencies, details = int(sheet.details["frequencies"]), sheet.details
    seen = ready(side).view(SEEN)[:, 0]
    sigma = sheet.sigma * noise_factor(seen["density_ratio"])[:, None]
    lasting = range_error(seen["elevation"], details["signal_error"], details["multipath"] * amplification(frequencies))
    variance = (sigma[:, 0] * amplification(frequencies)) ** 2 + lasting**2
    delay, blocks = seen["troposphere"].copy(), {block.name: block.sigma for block in sheet.blocks}
    covariance = np.diag(variance + _LEAST_SIGMA[0] ** 2)
    common = [seen["mapping"] * blocks["troposphere"]]
    if frequencies == 1:
        delay += seen["ionosphere"]
        common.append(seen["ionosphere"] * blocks["ionosphere"])
    for error in common:
        covariance += np.outer(error, error)
    rate_sigma = np.hypot(sigma[:, 1], _LEAST_SIGMA[1])
    return Ranges(side[:, 0:3], side[:, 3:6], value[:, 0] - delay, value[:, 1], covariance, rate_sigma)
