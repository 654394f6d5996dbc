"""Files of the oracle's runs: one a scenario, one line a run, so that a long measurement goes on where it was.

The first line holds a key of the scenario's content, the simulator's code and the oracle's. A file with another key is
begun anew.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.estimator import find
from simnav.leaderboard.campaign.fingerprint import digest, estimator_source, recording_digest, simulator_version
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.provenance import numerics

if TYPE_CHECKING:
    from simnav.estimators.reference import OracleRun
    from simnav.scenario import Scenario

__all__ = ["OracleRuns"]


class OracleRuns:
    """The runs of the oracle on one scenario that are in a folder.

    Parameters
    ----------
    scenario : Scenario
        A simulated one.
    folder : path
        Made if it is not there.

    Attributes
    ----------
    runs : dict of int to OracleRun
        Runs of the oracle, by seed.
    """

    def __init__(self, scenario: Scenario, folder: str | os.PathLike[str]):
        self.scenario = scenario
        self.path = Path(folder) / f"{scenario.id}.jsonl"
        oracle = estimator_source(find("oracle-rts"))
        self._head = json.dumps({
            "key": digest(recording_digest(scenario, simulator_version()), oracle, *numerics())
        })  # fmt: skip
        self.runs: dict[int, OracleRun] = dict(self._read())

    def _read(self) -> Iterator[tuple[int, OracleRun]]:
        from simnav.estimators.reference import OracleRun

        try:
            lines = self.path.read_text().split("\n")
        except FileNotFoundError:
            return
        except (OSError, UnicodeDecodeError) as error:
            raise RequestError(f"{self.path} cannot be read: {error}") from None
        if lines[0] != self._head:
            return
        for number, line in enumerate(lines[1:-1], 2):  # what follows the last line's end was cut off by a kill
            try:
                run = OracleRun(**json.loads(line))
                if not all(math.isfinite(x) and x > 0.0 for k, x in asdict(run).items() if k != "seed"):
                    raise ValueError("its figures should be finite and above 0")
            except (ValueError, TypeError) as error:
                raise RequestError(f"{self.path}, line {number}, is no run of the oracle: {error}") from None
            yield run.seed, run

    def measure(self, seeds: Iterable[int], workers: int = 1) -> Iterator[OracleRun]:
        """Run the oracle on the seeds that are missing, and add each to the file when it is done.

        Raises
        ------
        SpecError
            Where the oracle fails.
        """
        from joblib import Parallel, delayed

        from simnav.estimators.reference import oracle_run

        missing = [s for s in seeds if s not in self.runs]
        if not missing:
            return
        self._begin()
        jobs = (delayed(oracle_run)(self.scenario, s) for s in missing)
        with open(self.path, "a") as file:
            for run in Parallel(n_jobs=workers, return_as="generator_unordered")(jobs):
                file.write(json.dumps(asdict(run)) + "\n")
                file.flush()
                self.runs[run.seed] = run
                yield run

    def _begin(self) -> None:
        """Write head and runs anew: the file may be missing, be of another key, or end in half a line."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        lines = [self._head, *(json.dumps(asdict(r)) for r in self.runs.values())]
        write_whole(self.path, "\n".join(lines) + "\n")
