"""The errors of one instrument over recordings and over simulated runs, against the reference."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from simnav.log.channel import list_recordings
from simnav.log.source import LogSource
from simnav.scenario import Scenario
from simnav.sensors import AidSpec, DerivedInstrument
from simnav.simulation.simulator import ideal
from simnav.source import record
from simnav.spec import SpecError, closest
from simnav.types import KINDS, Array

__all__ = ["ErrorSeries", "comparable", "real_errors", "simulated_errors"]


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
        Readings a second that the instrument should give [Hz].
    duration : float
        Length of the run [s].
    """

    run: str
    time: Array
    error: Array
    rate: float
    duration: float


def comparable(simulated: Scenario, recorded: Scenario) -> list[str]:
    """The instruments that are measured in a log, and that a simulated scenario has under the same name and kind.

    Raises
    ------
    SpecError
        If the second scenario is not recorded.
    """
    if recorded.log is None:
        raise SpecError(f"{recorded.id} has no [log]: it is no recording with which a simulation can be compared")
    return [
        name
        for name, spec in recorded.aids.items()
        if recorded.log.instruments[name].source != "reference"
        and name in simulated.aids
        and simulated.aids[name].kind == spec.kind
        and not simulated.aids[name].channels()
    ]


def _spec(scenario: Scenario, name: str) -> AidSpec:
    spec = scenario.aids.get(name)
    if spec is None:
        raise SpecError(f"{scenario.id} has no instrument {name!r}{closest(name, list(scenario.aids))}")
    return spec


def real_errors(scenario: Scenario, name: str) -> list[ErrorSeries]:
    """The errors of a measured instrument, one series for each recording of the log.

    The reading without error is that of the reference, with the lever arm of the scenario.

    Raises
    ------
    SpecError
        If the scenario has no such instrument, or it is not measured.
    LogError
        If the log is absent.
    """
    spec = _spec(scenario, name)
    assert scenario.log is not None
    if scenario.log.instruments[name].source == "reference":
        raise SpecError(f"{scenario.id}: {name!r} is itself simulated from the reference")
    plain = scenario.model_copy(update={"faults": ()})
    found = []
    for seed, recording in enumerate(list_recordings(scenario.log)):
        source = LogSource(plain, seed)
        stream = source.advance(source.duration).aids[name]
        exact = spec.ideal().install(name, 0, source.surroundings)
        if isinstance(exact, DerivedInstrument):
            raise SpecError(f"{scenario.id}: {name!r} reads another instrument; the reference does not say its reading")
        value, _, _ = exact.reading(source.taps(stream.time))
        error = KINDS[spec.kind].difference(stream.value, value)
        known = np.isfinite(error).all(axis=1)
        # The rate of the datasheet is a limit; the log says how often the instrument really speaks.
        rate = float(1.0 / np.median(np.diff(stream.time))) if len(stream.time) > 1 else spec.rate
        time = stream.time[known]
        found.append(ErrorSeries(recording or "recording", time, error[known], rate, source.duration))
    return found


def simulated_errors(scenario: Scenario, name: str, seeds: Iterable[int]) -> list[ErrorSeries]:
    """The errors of an instrument in simulated runs, without faults.

    A recorded scenario is taken, too, if the instrument is simulated from its reference.
    """
    spec = _spec(scenario, name)
    plain = scenario.model_copy(update={"faults": ()})
    if plain.log is not None:
        if plain.log.instruments[name].source != "reference":
            raise SpecError(f"{scenario.id}: {name!r} is measured, not simulated")
        return [_from_reference(plain, spec, name, seed) for seed in seeds]
    kept = {key: given for key, given in plain.instruments.items() if key in (name, *spec.sources())}
    plain = plain.model_copy(update={"instruments": kept})
    found = []
    for seed in seeds:
        stream, exact = record(plain, seed).data.aids[name], ideal(plain, seed).data.aids[name]
        error = KINDS[spec.kind].difference(stream.value, exact.value)
        found.append(ErrorSeries(f"seed {seed}", stream.time, error, spec.rate, float(plain.duration)))
    return found


def _from_reference(scenario: Scenario, spec: AidSpec, name: str, seed: int) -> ErrorSeries:
    source = LogSource(scenario, seed)
    stream = source.advance(source.duration).aids[name]
    value, _, _ = spec.ideal().install(name, 0, source.surroundings).reading(source.taps(stream.time))
    error = KINDS[spec.kind].difference(stream.value, value)
    series = ErrorSeries(f"seed {seed}", stream.time, error, spec.rate, source.duration)
    known = np.isfinite(error).all(axis=1)
    return replace(series, time=series.time[known], error=series.error[known])
