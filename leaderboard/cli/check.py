"""``simnav check``: the contract test of an estimator."""

from __future__ import annotations

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.running import check

from .commands import CheckCommand
from .console import FAILED, Output

__all__ = ["show"]


def show(out: Output, request: CheckCommand) -> None:
    """Test an estimator against the contract: causality, shapes, determinism, missing instruments."""
    report = check(request.estimator, **(request.parameters or {}))
    out.document(report.to_dict())
    out.print(tables.table(f"{report.estimator} and the contract", ["", "test", "finding"],
                           [["ok" if f.ok else "FAIL", f.name, f.sentence] for f in report.findings],
                           strong=[i for i, f in enumerate(report.findings) if not f.ok]),
              f"{report.estimator} {'passes' if report.passed else 'fails'}")  # fmt: skip
    out.code = 0 if report.passed else FAILED
