"""The errors of one instrument over recordings and over simulated runs, against the reference."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from simnav.kinds import Kind
from simnav.log.source import LogSource
from simnav.scenario import Scenario
from simnav.scenario.residuals import ErrorSeries, instrument_of
from simnav.sensors import AidSpec
from simnav.simulation.simulator import ideal
from simnav.source import record
from simnav.spec import SpecError
from simnav.types import KINDS

__all__ = ["ErrorSeries", "comparable", "simulated_errors"]


def comparable(simulated: Scenario, recorded: Scenario) -> list[tuple[str, str]]:
    """Pairs of a simulated instrument and of one that is measured in a log, which measure the same.

    Their kinds are predicted by the same equation and have the same components: a velocity that is solved from beams
    is like that of a DVL.

    Raises
    ------
    SpecError
        If the second scenario is not recorded.
    """
    if recorded.log is None:
        raise SpecError(f"{recorded.id} has no [log]: it is no recording with which a simulation can be compared")
    logged = recorded.log.instruments
    measured = {name: spec for name, spec in recorded.aids.items() if logged[name].source != "reference"}
    return [
        (name, other)
        for other, there in measured.items()
        for name, here in simulated.aids.items()
        if not here.channels() and _same(here.definition, there.definition)
    ]


def _same(one: Kind, other: Kind) -> bool:
    return one is other or (
        one.equation == other.equation and one.equation is not None and one.components == other.components
    )


def simulated_errors(scenario: Scenario, name: str, seeds: Iterable[int]) -> list[ErrorSeries]:
    """The errors of an instrument in simulated runs, without faults.

    A recorded scenario is taken, too, if the instrument is simulated from its reference.
    """
    spec = instrument_of(scenario, name)
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
