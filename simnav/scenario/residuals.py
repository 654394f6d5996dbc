"""The errors of a measured instrument of a recorded scenario: its readings less what the reference says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simnav.log.channel import list_recordings
from simnav.log.source import LogSource
from simnav.scenario.scenario import Scenario
from simnav.sensors import AidSpec, DerivedInstrument
from simnav.spec import SpecError, closest
from simnav.types import KINDS, Array, TapStates

__all__ = ["ErrorSeries", "instrument_of", "residuals"]


@dataclass(frozen=True, eq=False)
class ErrorSeries:
    """The error of one instrument in one run.

    Attributes
    ----------
    run : str
        The recording or the seed.
    time : (n,) array
        [s].
    error : (n, d) array
        Reading less what the reference says, components as in ``Kind.errors``, SI units.
    rate : float
        Readings a second [Hz].
    duration : float
        Length of the run [s].
    taps : TapStates or None
        The motion at the n times, where it is known.
    """

    run: str
    time: Array
    error: Array
    rate: float
    duration: float
    taps: TapStates | None = None


def instrument_of(scenario: Scenario, name: str) -> AidSpec:
    """The specification of an aiding instrument; SpecError if there is none of that name."""
    spec = scenario.aids.get(name)
    if spec is None:
        raise SpecError(f"{scenario.id} has no instrument {name!r}{closest(name, list(scenario.aids))}")
    return spec


def residuals(scenario: Scenario, name: str) -> list[ErrorSeries]:
    """The errors of a measured instrument, one series for each recording of the log.

    The reading without error is that of the reference, with the lever arm of the scenario.

    Raises
    ------
    SpecError
        If the scenario is not recorded, has no such instrument, or does not measure it.
    LogError
        If the log is absent.
    """
    if scenario.log is None:
        raise SpecError(f"{scenario.id} has no [log]: it is no recording")
    spec = instrument_of(scenario, name)
    if scenario.log.instruments[name].source == "reference":
        raise SpecError(f"{scenario.id}: {name!r} is not measured; it is simulated from the reference")
    plain = scenario.model_copy(update={"faults": ()})
    found = []
    for seed, recording in enumerate(list_recordings(scenario.log)):
        source = LogSource(plain, seed)
        stream = source.advance(source.duration).aids[name]
        exact = spec.ideal().install(name, 0, source.surroundings)
        if isinstance(exact, DerivedInstrument):
            raise SpecError(f"{scenario.id}: {name!r} reads another instrument; the reference does not say its reading")
        taps = source.taps(stream.time)
        value, _, _ = exact.reading(taps)
        error = KINDS[spec.kind].difference(stream.value, value)
        known = np.isfinite(error).all(axis=1)
        # The rate of the datasheet is a limit; the log says how often the instrument really speaks.
        rate = float(1.0 / np.median(np.diff(stream.time))) if len(stream.time) > 1 else spec.rate
        here = TapStates(**{name: getattr(taps, name)[known] for name in taps.__dataclass_fields__})
        found.append(
            ErrorSeries(recording or "recording", stream.time[known], error[known], rate, source.duration, here)
        )
    return found
