"""What a log does not tell, in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from simnav.scenario import Scenario

from .choices import fitted_aids
from .estimates import AXES, Estimated
from .search import Fitted

__all__ = ["remarks"]

#: From this correlation on two estimates cannot be told apart.
_ALIKE = 0.9


def remarks(scenario: Scenario, fitted: Fitted, found: Sequence[Estimated]) -> list[str]:
    """Sentences about an error model.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    fitted : Fitted
        The fit.
    found : sequence of Estimated
        Its estimates.
    """
    said = []
    sizes = [e for e in found if not e.told and not e.constant]
    said += [f"{e.label}: the log does not tell it; anything up to {e.high:.2g} fits" for e in sizes]
    constants = dict[str, list[str]]()
    for e in found:
        if not e.told and e.constant:
            constants.setdefault(e.key, []).append(e.part)
    for key, parts in constants.items():
        which = f" ({', '.join(parts)})" if all(parts) else ""
        said.append(f"{key}{which}: the motion of this log does not tell it, so the scenario's figure stays")
    said += [
        f"{e.label}: its interval, {e.low:.3g} to {e.high:.3g}, does not contain the scenario's {e.now:.3g}, but the "
        "motion does not tell it well enough to correct it; 'simnav log align' compares it with the reference"
        for e in found
        if not e.told and e.constant and e.key.endswith("lever_arm_m") and not e.low <= e.now <= e.high
    ]
    said += [f"{a} and {b} cannot be told apart (correlation {r:+.2f})" for a, b, r in _alike(fitted)]
    for name, sheet in fitted.maximum.assumed.instruments.items():
        if sheet.bias_instability.any():
            said.append(f"{name}: a coloured error fits; a constant bias is in it, because ekf has one state for both")
        if name in fitted.coloured:
            said.append(
                f"{name}: neighbouring innovations still correlate by {fitted.coloured[name]:.2f}, so its model lacks "
                "something: its intervals are too narrow, and its lever arm and delay stay as they are"
            )
    fits = fitted_aids(scenario, fitted.maximum.assumed)
    others = [n for n in fitted.maximum.assumed.instruments if n not in fits]
    if others:
        said.append(
            f"{', '.join(others)}: used as the datasheet says, not fitted (channels, readings that state their sigma, "
            "or figures of their own)"
        )
    return said


def _alike(fitted: Fitted) -> list[tuple[str, str, float]]:
    """Pairs of numbers that correlate."""
    maximum, states = fitted.maximum, fitted.states
    names = [p.label for p in maximum.parameters]
    known = fitted.maximum.assumed.instruments
    used = list(range(len(names)))
    for label, at in states.place.items():
        if label.partition(".")[0] in (*known, known.imu.name if known.imu else ""):
            used += range(len(maximum.x) + at.start, len(maximum.x) + at.stop)
        names += [f"{label} ({k})" if at.stop - at.start > 1 else label for k in AXES[: at.stop - at.start]]
    covariance = np.block([[maximum.covariance, fitted.cross], [fitted.cross.T, states.covariance]])
    sigma = np.sqrt(np.maximum(covariance.diagonal(), 1e-300))
    correlation = covariance / np.outer(sigma, sigma)
    return [
        (names[i], names[j], float(correlation[i, j]))
        for i, j in combinations(used, 2)
        if abs(correlation[i, j]) > _ALIKE
    ]
