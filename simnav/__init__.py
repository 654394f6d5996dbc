"""simnav: the open benchmark for marine integrated navigation.

Importing it registers every scenario of the catalogue with Gymnasium, so that
``gymnasium.make("simnav:simnav/OpenSea-v1")`` works (`simnav.gymnasium_ids`). Each public name is loaded when it is
first used, so that the import itself is quick.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path as _Path
from typing import TYPE_CHECKING, Any

from simnav.checkout import require_links as _require_links
from simnav.gymnasium_ids import register_with_gymnasium as _register_with_gymnasium

_require_links(_Path(__file__).parent)

if TYPE_CHECKING:
    from simnav.blocks import StateBlock
    from simnav.environment import EstimatorAgent, NavigationEnv, NavigationVectorEnv, windows
    from simnav.estimator import Estimator, UnsuitableScenario, names, register
    from simnav.kinds import Component, Kind
    from simnav.leaderboard.claiming import claim
    from simnav.leaderboard.costing import bench, costs
    from simnav.leaderboard.datasets import dataset, read_voyages, voyages
    from simnav.leaderboard.inspection import (
        allan,
        bound,
        cite,
        merge,
        rank,
        realism,
        reproduce,
        rescore,
        seal,
        verify,
    )
    from simnav.leaderboard.logs import align, export, identify, inspect_log, recordings, score_files, tune_noise, twin
    from simnav.leaderboard.publishing import (
        audit_standard,
        check_standard,
        draw_standard,
        publish_standard,
        run_standard,
        site,
        standard,
        submit,
        verify_bundle,
    )
    from simnav.leaderboard.recommending import recommend
    from simnav.leaderboard.results.errors import RequestError
    from simnav.leaderboard.running import campaign, check, evaluate, make, record, robustness, run, sweep, tune
    from simnav.plugins import load_plugin
    from simnav.recording import Recording
    from simnav.scenario import Scenario, load
    from simnav.scoring import register_score, score
    from simnav.sensors import register_fault, register_instrument
    from simnav.source import open_source
    from simnav.trial import Trial, run_trial
    from simnav.types import (
        COMPONENTS,
        KINDS,
        Datasheet,
        Estimate,
        ImuDatasheet,
        ImuSamples,
        InitialState,
        Instruments,
        Measurement,
        Measurements,
        NavigationStates,
        TriadDatasheet,
    )

__all__ = [
    "COMPONENTS",
    "KINDS",
    "Component",
    "Datasheet",
    "Estimate",
    "Estimator",
    "EstimatorAgent",
    "ImuDatasheet",
    "ImuSamples",
    "InitialState",
    "Instruments",
    "Kind",
    "Measurement",
    "Measurements",
    "NavigationEnv",
    "NavigationStates",
    "NavigationVectorEnv",
    "Recording",
    "RequestError",
    "Scenario",
    "StateBlock",
    "TriadDatasheet",
    "Trial",
    "UnsuitableScenario",
    "align",
    "allan",
    "audit_standard",
    "bench",
    "bound",
    "campaign",
    "check",
    "check_standard",
    "cite",
    "claim",
    "costs",
    "dataset",
    "draw_standard",
    "evaluate",
    "export",
    "identify",
    "inspect_log",
    "load",
    "load_plugin",
    "make",
    "merge",
    "names",
    "open_source",
    "publish_standard",
    "rank",
    "read_voyages",
    "realism",
    "recommend",
    "record",
    "recordings",
    "register",
    "register_fault",
    "register_instrument",
    "register_score",
    "reproduce",
    "rescore",
    "robustness",
    "run",
    "run_standard",
    "run_trial",
    "score",
    "score_files",
    "seal",
    "site",
    "standard",
    "submit",
    "sweep",
    "tune",
    "tune_noise",
    "twin",
    "verify",
    "verify_bundle",
    "voyages",
    "windows",
]

# Modules, loaded when one of their names is first used. Those of the third floor are named by a string, because
# the library must not import a floor above it.
_HOMES = {
    "blocks": ("StateBlock",),
    "environment": ("EstimatorAgent", "NavigationEnv", "NavigationVectorEnv", "windows"),
    "estimator": ("Estimator", "UnsuitableScenario", "names", "register"),
    "kinds": ("Component", "Kind"),
    "plugins": ("load_plugin",),
    "recording": ("Recording",),
    "scenario": ("Scenario", "load"),
    "scoring": ("register_score", "score"),
    "sensors": ("register_fault", "register_instrument"),
    "source": ("open_source",),
    "trial": ("Trial", "run_trial"),
    "types": (
        "COMPONENTS",
        "KINDS",
        "Datasheet",
        "Estimate",
        "ImuDatasheet",
        "ImuSamples",
        "InitialState",
        "Instruments",
        "Measurement",
        "Measurements",
        "NavigationStates",
        "TriadDatasheet",
    ),
    "leaderboard.claiming": ("claim",),
    "leaderboard.costing": ("bench", "costs"),
    "leaderboard.datasets": ("dataset", "read_voyages", "voyages"),
    "leaderboard.inspection": (
        "allan",
        "bound",
        "cite",
        "merge",
        "rank",
        "realism",
        "reproduce",
        "rescore",
        "seal",
        "verify",
    ),
    "leaderboard.logs": (
        "align",
        "export",
        "identify",
        "inspect_log",
        "recordings",
        "score_files",
        "tune_noise",
        "twin",
    ),
    "leaderboard.recommending": ("recommend",),
    "leaderboard.results.errors": ("RequestError",),
    "leaderboard.running": ("campaign", "check", "evaluate", "make", "record", "robustness", "run", "sweep", "tune"),
    "leaderboard.publishing": (
        "audit_standard",
        "check_standard",
        "draw_standard",
        "publish_standard",
        "run_standard",
        "site",
        "standard",
        "submit",
        "verify_bundle",
    ),
}
_home_of = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("simnav")
    if name in _HOMES:  # simnav.scenario.load
        return import_module(f"simnav.{name}")
    if name not in _home_of:
        raise AttributeError(f"module 'simnav' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"simnav.{_home_of[name]}"), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


_register_with_gymnasium()
