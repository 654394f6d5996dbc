"""The scenario that a result names: of the catalogue, by its versioned id, and never a path.

`simnav.scenario.load` also reads files, and imports the plug-ins that they name. A result of others must not choose
which file that is. A scenario that is not in the catalogue is given by the user (``--scenario FILE``).
"""

from __future__ import annotations

from simnav.scenario import Scenario, headers, load

from .admission import is_scenario_id
from .errors import RequestError, mistakes

__all__ = ["catalogued_scenario"]


def catalogued_scenario(identity: str) -> Scenario:
    """The scenario of the catalogue with this versioned id.

    Parameters
    ----------
    identity : str
        As it stands in a result or a bundle.

    Raises
    ------
    RequestError
        If it is no versioned id, or the catalogue has no such scenario: one sentence.
    """
    if not is_scenario_id(identity):
        raise RequestError(f"scenario = {identity!a:.80} is no versioned id of the catalogue")
    if not any(h.id == identity for h in headers()):
        raise RequestError(f"scenario {identity} is not in the catalogue; give its file with --scenario")
    with mistakes(ValueError):
        return load(identity)  # by its name: simnav's own need no trial at the ends of their ranges
