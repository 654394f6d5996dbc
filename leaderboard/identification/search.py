"""The order in which the error model of a log is found.

1. Heading at the start, white noise, lever arms and delays.
2. Instruments get a coloured error, and triads of the IMU an in-run bias, one by one, as long as one of them makes the
   log more likely by more than its parameters would by chance.
3. All together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from simnav.scenario import Scenario
from simnav.types import Array

from . import choices
from .assumption import Assumption, Parameter, with_all
from .innovations import Likelihood, StateValues, neighbours
from .scoring import Maximum, log_likelihood, maximise

__all__ = ["Fitted", "search"]

#: Headings that are tried at first, in sigmas of the start, where that sigma is above the limit [rad].
_TRIES, _POOR = np.linspace(-2.5, 2.5, 11), np.radians(5.0)
#: By so much a coloured error of an instrument, or an in-run bias of a triad, makes a log more likely.
_COLOURED, _IN_RUN = 6.0, 3.0
#: From this correlation of neighbours on, innovations are not white.
_NOT_WHITE = 0.2
#: Steps of scoring for a first look.
_LOOK = 4


@dataclass(frozen=True, eq=False)
class Fitted:
    """The error model of a log.

    Attributes
    ----------
    maximum : Maximum
        Sizes, lever arms, delays and heading.
    states : StateValues
        Biases, scale factors and mountings, with what is not known of the former in their covariance.
    cross : (p, m) array
        Covariance of the numbers of the maximum and the states.
    coloured : mapping of str to float
        Correlation of neighbouring innovations of the instruments where it is still large.
    """

    maximum: Maximum
    states: StateValues
    cross: Array
    coloured: Mapping[str, float]


def search(scenario: Scenario, likelihood: Likelihood, given: Assumption) -> Fitted:
    """Find the error model of a log.

    Parameters
    ----------
    scenario : Scenario
        Its scenario.
    likelihood : Likelihood
        That of the recording.
    given : Assumption
        The datasheets of the scenario.
    """
    assumed = choices.with_wide_states(scenario, given)
    sigma = float(np.sqrt(likelihood.start.covariance[8, 8]))
    start = choices.heading(sigma)
    if sigma > _POOR:
        tries = [replace(assumed, heading=sigma * float(k)) for k in _TRIES]
        assumed = max(tries, key=lambda a: log_likelihood(likelihood.innovations(a)))
    assumed = maximise(likelihood, assumed, [_at(start, assumed), *choices.sizes(scenario, assumed)]).assumed
    others = choices.places(scenario, assumed)
    assumed = maximise(
        likelihood, assumed, [_at(start, assumed), *choices.sizes(scenario, assumed), *others], _LOOK
    ).assumed
    assumed = _coloured(scenario, likelihood, assumed)
    everything = [
        _at(start, assumed),
        *choices.sizes(scenario, assumed),
        *(_at(p, assumed) for p in others),
    ]
    found = maximise(likelihood, assumed, everything)
    return _with_states(likelihood, found, assumed)


def _with_states(likelihood: Likelihood, found: Maximum, begun: Assumption) -> Fitted:
    """The states at a maximum. Each of its numbers moves them: to first order that adds to their covariance."""
    states = likelihood.states(found.assumed)
    jacobian = np.zeros((len(found.x), len(states.value)))
    for i, parameter in enumerate(found.parameters):
        beside, step = found.x.copy(), parameter.steps[1]
        beside[i] += step
        moved = likelihood.states(with_all(begun, found.parameters, beside))
        jacobian[i] = (moved.value - states.value) / step
    cross = found.covariance @ jacobian
    correlations = {n: neighbours(s.white) for n, s in likelihood.innovations(found.assumed).items()}
    coloured = {n: r for n, r in correlations.items() if abs(r) > _NOT_WHITE}
    return Fitted(found, replace(states, covariance=states.covariance + jacobian.T @ cross), cross, coloured)


def _at(parameter: Parameter, assumed: Assumption) -> Parameter:
    """A constant that begins where the assumption has it."""
    if parameter.figure == "error":
        return replace(parameter, first=assumed.heading)
    if parameter.figure == "delay":
        return replace(parameter, first=assumed.delays.get(parameter.instrument, 0.0))
    first = float(assumed.instruments[parameter.instrument].lever_arm[parameter.components[0]])
    return replace(parameter, first=first)


def _coloured(scenario: Scenario, likelihood: Likelihood, assumed: Assumption) -> Assumption:
    """With coloured errors and in-run biases, as long as they are worth their parameters."""
    value = log_likelihood(likelihood.innovations(assumed))
    while True:
        found: list[tuple[float, Maximum]] = []
        imu = ("gyroscope", "accelerometer")
        for name, begins in choices.coloured(scenario, assumed):
            best = max(begins, key=lambda a: log_likelihood(likelihood.innovations(a)))
            # A wide prior of a bias costs some likelihood, which is no sign of colour.
            white = log_likelihood(likelihood.innovations(choices.without_bias(assumed, name)))
            looked = maximise(likelihood, best, choices.sizes(scenario, best, (name, *imu)), _LOOK)
            found.append((looked.log_likelihood - max(value, white) - _COLOURED, looked))
        for begin in choices.in_run(assumed):
            looked = maximise(likelihood, begin, choices.sizes(scenario, begin, imu), _LOOK)
            found.append((looked.log_likelihood - value - _IN_RUN, looked))
        gain, best_found = max(found, key=lambda pair: pair[0], default=(-1.0, None))
        if gain <= 0.0 or best_found is None:
            return assumed
        again = maximise(likelihood, best_found.assumed, choices.sizes(scenario, best_found.assumed), _LOOK)
        assumed, value = again.assumed, again.log_likelihood
