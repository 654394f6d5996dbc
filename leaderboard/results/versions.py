"""The address of a result that ships: declared versions of all that decides it, and no digest of code.

What comes with simnav is computed once and read for years, so a wording, a name or a comment in the code must not make
it out of date. Its address is the version of the benchmark, the versioned id of the scenario, the version of the
simulator, label, version and parameters of the row, and the seed. ``tests/golden`` demands a new version where a number
changes. A submission has the same address, with a digest of the submitter's own files: of these nobody declares a
version that others could rely on.

Folders of local campaigns have digests of code instead (`simnav.leaderboard.campaign.fingerprint`).
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from .provenance import BENCHMARK
from .result import Result

__all__ = ["declared", "declared_recording", "declared_variant", "is_declared"]


def declared_recording(simulator: int) -> str:
    """What names the recordings of a scenario by the version of the simulator.

    >>> declared_recording(1)
    'simulator-1'
    """
    return f"simulator-{simulator}"


def is_declared(recording: str) -> bool:
    """Whether the recordings are named by a version, not by a digest of code.

    >>> is_declared("simulator-1"), is_declared("a3c88f0ffd0db268d1ff86a9")
    (True, False)
    """
    return re.fullmatch(r"simulator-\d+", recording) is not None


def declared_variant(
    scenario: str, simulator: int, label: str, version: int, parameters: Mapping[str, Any], own: str = ""
) -> str:
    """The key of an estimator's results without the seed.

    Parameters
    ----------
    scenario : str
        Versioned id.
    simulator, version : int
        Versions of the simulator and of the estimator.
    label : str
        Label of the estimator.
    parameters : mapping
        That were set.
    own : str
        Digest of the files of an estimator that does not come with simnav.
    """
    facts = [BENCHMARK, scenario, simulator, label, version, dict(parameters), *filter(None, [own])]
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.blake2b(text.encode(errors="surrogatepass"), digest_size=12).hexdigest()


def declared(results: Iterable[Result]) -> list[Result]:
    """Results under the address of their declared versions.

    Results that were computed before versions were declared count as version 1 of simulator and estimator.
    """
    return [
        replace(
            r,
            key=f"{declared_variant(r.scenario, r.simulator_version, r.estimator, r.estimator_version, r.parameters)}"
            f"-{r.seed}",
            recording=declared_recording(r.simulator_version),
        )
        for r in results
    ]
