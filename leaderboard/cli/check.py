"""``simnav check``: the contract test of an estimator, or a check of a scenario and its log."""

from __future__ import annotations

from simnav.leaderboard.arguments import scenario_of
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.running import check
from simnav.log.check import check_log
from simnav.scenario import names

from .commands import CheckCommand
from .console import FAILED, Output

__all__ = ["show"]


def show(out: Output, request: CheckCommand) -> None:
    """Test an estimator against the contract, or read the log of a scenario."""
    if request.estimator.endswith(".toml") or request.estimator in names():
        _show_scenario(out, request)
        return
    report = check(request.estimator, **(request.parameters or {}))
    out.document(report.to_dict())
    out.print(tables.table(f"{report.estimator} and the contract", ["", "test", "finding"],
                           [["ok" if f.ok else "FAIL", f.name, f.sentence] for f in report.findings],
                           strong=[i for i, f in enumerate(report.findings) if not f.ok]),
              f"{report.estimator} {'passes' if report.passed else 'fails'}")  # fmt: skip
    out.code = 0 if report.passed else FAILED


def _show_scenario(out: Output, request: CheckCommand) -> None:
    """What every recording of a scenario holds, and all that stops or disturbs a run."""
    if request.parameters:
        raise RequestError(f"--set is for estimators, and {request.estimator} is a scenario")
    scenario = scenario_of(request.estimator)
    if scenario.log is None:
        out.document({"scenario": scenario.id, "passed": True, "findings": []})
        out.print(f"{scenario.id} is valid; it is simulated, so there is no log to read")
        return
    found = check_log(scenario)
    out.document(found.to_dict())
    levels = {"ok": "ok", "note": "note", "error": "FAIL"}
    rows = [[levels[f.level], f.recording, f.part, f.sentence] for f in found.findings]
    bad = [i for i, f in enumerate(found.findings) if f.level == "error"]
    out.print(tables.table(f"the log of {scenario.id}", ["", "recording", "part", "finding"], rows, strong=bad),
              f"{scenario.id}: {'all recordings can be run' if found.passed else f'{len(bad)} errors'}")  # fmt: skip
    out.code = 0 if found.passed else FAILED
