"""The velocity that a Doppler velocity log solves from its beams: the second instrument of one device.

It takes the readings of the instrument ``beams`` (`simnav.sensors.dvl_beams`), with all their faults, and solves each
ping by least squares (`simnav.sensors.janus.solve_beams`). There is a reading with four beams, unless their error
velocity is too large, and with three, unless ``three_beams`` is false. The faults of a reading are those of its beams;
its ``fault_error`` is the difference from the solution of the same beams without them.

`DvlSolution` takes beams with bottom track; beams with water track are solved by
`simnav.sensors.dvl_water_solution.DvlWaterSolution`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from simnav import kinds
from simnav.compiled import Integers
from simnav.kinds import Kind, speed_components
from simnav.recording import AidStream
from simnav.sensors.derived import DerivedInstrument
from simnav.sensors.errors import InstrumentError
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, SigmaTriple, register_instrument
from simnav.sensors.janus import JanusSolution, solve_beams
from simnav.spec import NonNegative, Positive, Vector, quantity
from simnav.types import Array, Datasheet

__all__ = ["BeamSolution", "DvlSolution", "solutions"]

#: Times closer than this are one and the same [s].
_SAME = 1e-6


def solutions(stream: AidStream, time: Array | None = None) -> tuple[Array, JanusSolution]:
    """The solution of each ping of a stream of beams.

    Error velocity, figure of merit and covariance of each ping are in it.

    Parameters
    ----------
    stream : AidStream
        Readings of an instrument of kind ``dvl_beams``.
    time : (n,) array, optional
        Times of the pings [s]; those of the readings are the default.

    Returns
    -------
    (n,) array
        Times of the pings [s].
    JanusSolution
        NaN where a ping has fewer than three beams.
    """
    times = np.unique(stream.time) if time is None else time
    return times, _solved(stream, stream.value, _pings(stream, times))


def _pings(stream: AidStream, time: Array) -> Integers:
    """(m,) number of the ping that each reading belongs to; -1: none of them."""
    at = np.searchsorted(time, stream.time - _SAME)
    near = at < len(time)
    near[near] = abs(time[at[near]] - stream.time[near]) <= _SAME
    return np.where(near, at, -1)


def _solved(stream: AidStream, value: Array, ping: Integers) -> JanusSolution:
    """The solutions of the pings 0 to the largest one in ``ping``."""
    of, count = ping >= 0, int(ping.max(initial=-1)) + 1
    radial, sigma, side = np.full((count, 4), np.nan), np.zeros((count, 4)), np.zeros((4, 2))
    where = ping[of], stream.channel[of]
    radial[where], sigma[where] = value[of, 0], stream.sigma[of, 0]
    side[stream.channel] = stream.side[:, :2]
    return solve_beams(radial, side[:, 0], side[:, 1], sigma)


class BeamSolution(AidSpec):
    """What the solutions of both tracks have in common.

    Attributes
    ----------
    beams : str
        Name of the instrument of kind ``dvl_beams``.
    error_velocity : float
        Four beams with a larger error velocity give no reading [m/s].
    three_beams : bool
        Whether three beams give a reading. They have no error velocity.
    track : str
        What the beams hear: ``bottom`` or ``water``.
    """

    track: ClassVar[Literal["bottom", "water"]] = "bottom"

    beams: str = "dvl_beams"
    error_velocity: Positive = quantity("m_s", 0.1)
    three_beams: bool = Field(True, description="whether three beams are enough")

    def sources(self) -> Mapping[str, str]:
        """See `AidSpec.sources`."""
        return {self.beams: "dvl_beams"}

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Solver(self, name, seed)


class _Solver(DerivedInstrument):
    """Parameters as of `Instrument`."""

    def __init__(self, spec: BeamSolution, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec

    def derive(self, time: Array, streams: Mapping[str, AidStream], sheets: Mapping[str, Datasheet]) -> AidStream:
        """See `DerivedInstrument.derive`."""
        spec, source = self.spec, streams[self.spec.beams]
        if sheets[spec.beams].details["track"] != spec.track:
            raise InstrumentError(
                f"instrument {self.name!r} of kind {self.kind!r}: it needs beams with track = {spec.track!r}, but "
                f"{spec.beams!r} has {sheets[spec.beams].details['track']!r}"
            )
        ping = _pings(source, time)
        found = _solved(source, source.value, ping)
        healthy = _solved(source, source.value - source.fault_error, ping)
        count = len(found.beams)
        good = (found.beams >= (3 if spec.three_beams else 4)) & ~(abs(found.error_velocity) > spec.error_velocity)
        faults = np.zeros(count, np.uint32)
        np.bitwise_or.at(faults, ping[ping >= 0], source.faults[ping >= 0])
        wrong = np.where((faults != 0)[:, None], found.velocity - healthy.velocity, 0.0)
        sigma = np.sqrt(np.einsum("nii->ni", found.covariance))
        lost = np.append(time[:count][~good], time[count:])
        return AidStream(
            self.name, self.kind, time[:count][good], found.velocity[good], faults[good], wrong[good], sigma[good], lost
        )


@register_instrument(
    Kind(
        "velocity over the ground of the transducer that the beams give, in body axes",
        "velocity",
        speed_components("forward", "starboard", "down"),
        kinds.BODY_VELOCITY,
    ),
    example={"sigma_m_s": [0.003, 0.003, 0.001]},
)
class DvlSolution(BeamSolution):
    """Velocity over the ground in body axes, solved from the beams of another instrument with bottom track.

    Attributes
    ----------
    sigma, scale, misalignment, lever_arm
        What the datasheet says about the velocity; the error itself comes from the beams.
    """

    kind: Literal["dvl_solution"] = "dvl_solution"
    sigma: SigmaTriple = quantity("m_s")
    bias: SigmaTriple = quantity("m_s", ZERO)
    scale: NonNegative = quantity("percent", 0.0)
    misalignment: SigmaTriple = quantity("deg", ZERO)
    lever_arm: Vector = quantity("m", ZERO)
