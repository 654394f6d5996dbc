"""The velocity that a Doppler velocity log solves from its beams: the second instrument of one device.

It takes the readings of the instrument ``beams`` (`simnav.sensors.dvl_beams`), with all their faults, and solves each
ping by least squares (`simnav.sensors.janus.solve_beams`). There is a reading with four beams, unless their error
velocity is too large, and with three, unless ``three_beams`` is false. The beams have bottom track. The faults of a
reading are those of its beams; its ``fault_error`` is the difference from the solution of the same beams without them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from pydantic import Field

from simnav import kinds
from simnav.kinds import Kind, speed_components
from simnav.recording import AidStream
from simnav.sensors.derived import DerivedInstrument
from simnav.sensors.errors import InstrumentError
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, SigmaTriple, register_instrument
from simnav.sensors.janus import JanusSolution, solve_beams
from simnav.spec import NonNegative, Positive, Vector, quantity
from simnav.types import Array, Datasheet

__all__ = ["DvlSolution", "solutions"]

#: Times closer than this are one and the same [s].
_SAME = 1e-6


def solutions(stream: AidStream) -> list[tuple[float, JanusSolution | None]]:
    """The solution of each ping of a stream of beams: its time [s], and None with fewer than three beams.

    Error velocity, figure of merit and covariance of each ping are in it.
    """
    times, first = np.unique(stream.time, return_index=True)
    last = np.append(first[1:], len(stream.time))
    return [(float(t), _solved(stream, stream.value, slice(i, j))) for t, i, j in zip(times, first, last, strict=True)]


def _solved(stream: AidStream, value: Array, rows: slice) -> JanusSolution | None:
    side = stream.side[rows]
    return solve_beams(value[rows, 0], side[:, 0], side[:, 1], stream.sigma[rows, 0])


@register_instrument(
    Kind(
        "velocity over the ground of the transducer that the beams give, in body axes",
        "velocity",
        speed_components("forward", "starboard", "down"),
        kinds.BODY_VELOCITY,
    ),
    example={"sigma_m_s": [0.003, 0.003, 0.001]},
)
class DvlSolution(AidSpec):
    """Velocity over the ground in body axes, solved from the beams of another instrument.

    Attributes
    ----------
    beams : str
        Name of the instrument of kind ``dvl_beams`` with bottom track.
    error_velocity : float
        Four beams with a larger error velocity give no reading [m/s].
    three_beams : bool
        Whether three beams give a reading. They have no error velocity.
    sigma, scale, misalignment, lever_arm
        What the datasheet says about the velocity; the error itself comes from the beams.
    """

    kind: Literal["dvl_solution"] = "dvl_solution"
    beams: str = "dvl_beams"
    error_velocity: Positive = quantity("m_s", 0.1)
    three_beams: bool = Field(True, description="whether three beams are enough")
    sigma: SigmaTriple = quantity("m_s")
    bias: SigmaTriple = quantity("m_s", ZERO)
    scale: NonNegative = quantity("percent", 0.0)
    misalignment: SigmaTriple = quantity("deg", ZERO)
    lever_arm: Vector = quantity("m", ZERO)

    def sources(self) -> Mapping[str, str]:
        """See `AidSpec.sources`."""
        return {self.beams: "dvl_beams"}

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Solver(self, name, seed)


class _Solver(DerivedInstrument):
    """Parameters as of `Instrument`."""

    def __init__(self, spec: DvlSolution, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec

    def derive(self, time: Array, streams: Mapping[str, AidStream], sheets: Mapping[str, Datasheet]) -> AidStream:
        """See `DerivedInstrument.derive`."""
        spec, source = self.spec, streams[self.spec.beams]
        if sheets[spec.beams].details["track"] != "bottom":
            raise InstrumentError(
                f"instrument {self.name!r} of kind {self.kind!r}: it needs beams with track = 'bottom', but "
                f"{spec.beams!r} has {sheets[spec.beams].details['track']!r}"
            )
        first = np.searchsorted(source.time, time - _SAME)
        last = np.searchsorted(source.time, time + _SAME)
        kept, lost, rows = [], [], []
        for t, i, j in zip(time, first, last, strict=True):
            ping = slice(int(i), int(j))
            found = _solved(source, source.value, ping)
            if found is None or (found.beams == 3 and not spec.three_beams) or (
                found.beams == 4 and abs(found.error_velocity) > spec.error_velocity
            ):  # fmt: skip
                lost.append(t)
                continue
            kept.append(t)
            healthy = _solved(source, source.value - source.fault_error, ping)
            wrong = found.velocity - (found if healthy is None else healthy).velocity
            faults = int(np.bitwise_or.reduce(source.faults[ping]))
            rows.append((found.velocity, np.sqrt(np.diag(found.covariance)), faults, wrong if faults else np.zeros(3)))
        value, sigma, error = (np.array([row[k] for row in rows]).reshape(-1, 3) for k in (0, 1, 3))
        faults_of = np.array([row[2] for row in rows], dtype=np.uint32)
        return AidStream(self.name, self.kind, np.array(kept), value, faults_of, error, sigma, np.array(lost))
