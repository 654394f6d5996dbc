"""All commands of `simnav` as Python calls, which are also attributes of the package: ``simnav.evaluate(...)``.

An **estimator** is a class, a registered name, a file (``my.py``, ``my.py:MyFilter``), any of these with parameters
(``"sw-fgo:window=10"``, ``(MyFilter, {"gain": 0.5})``); several are a list, or a text with commas. A **scenario** is a
`simnav.scenario.Scenario`, a name or a TOML file. An empty list is refused; without one, all are meant. What comes
back is typed. Reports have ``to_dict()`` (what the command prints with ``--json``); those with figures, such as runs,
rankings and bounds, also have ``to_frame()`` (a ``pandas.DataFrame`` where pandas is installed, otherwise a
``pyarrow.Table``) and ``plot()`` (a matplotlib ``Figure``).

Mistakes in arguments raise `RequestError`, a `ValueError` whose message is one sentence.
"""

from __future__ import annotations

from simnav.leaderboard.campaign.request import EstimatorLike, Estimators
from simnav.leaderboard.results.errors import RequestError

from .arguments import results_of, scenario_of, scenarios_of
from .claiming import claim
from .costing import bench, costs
from .datasets import dataset, read_voyages, voyages
from .inspection import allan, bound, cite, merge, rank, realism, reproduce, rescore, seal, verify
from .logs import align, export, identify, inspect_log, recordings, score_files, tune_noise, twin
from .recommending import recommend
from .requests import ScenarioLike, Scenarios
from .running import campaign, check, evaluate, make, record, robustness, run, sweep, tune

__all__ = [
    "EstimatorLike",
    "Estimators",
    "RequestError",
    "ScenarioLike",
    "Scenarios",
    "align",
    "allan",
    "bench",
    "bound",
    "campaign",
    "check",
    "cite",
    "claim",
    "costs",
    "dataset",
    "evaluate",
    "export",
    "identify",
    "inspect_log",
    "make",
    "merge",
    "rank",
    "read_voyages",
    "realism",
    "recommend",
    "record",
    "recordings",
    "reproduce",
    "rescore",
    "results_of",
    "robustness",
    "run",
    "scenario_of",
    "scenarios_of",
    "score_files",
    "seal",
    "sweep",
    "tune",
    "tune_noise",
    "twin",
    "verify",
    "voyages",
]
