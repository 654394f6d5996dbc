"""``simnav check``: the contract test of an estimator."""

from __future__ import annotations

from typing import Annotated

import typer

from simnav.leaderboard.cli.console import FAILED, session
from simnav.leaderboard.cli.options import Debug, Json, Set, parameters
from simnav.leaderboard.results.errors import mistakes

__all__ = ["command"]


def command(
    file: Annotated[str, typer.Argument(metavar="FILE", help="my_filter.py, my_filter.py:MyFilter or a name.")],
    set_: Set = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Test an estimator against the contract: causality, shapes, determinism, missing instruments."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface
        from simnav.leaderboard.ranking import tables

        with mistakes(ValueError):
            report = interface.check(file, **parameters(set_))
        findings = [{"name": f.name, "ok": f.ok, "sentence": f.sentence} for f in report.findings]
        out.document({"estimator": report.estimator, "passed": report.passed, "findings": findings})
        out.print(tables.table(f"{report.estimator} and the contract", ["", "test", "finding"],
                               [["ok" if f.ok else "FAIL", f.name, f.sentence] for f in report.findings],
                               strong=[i for i, f in enumerate(report.findings) if not f.ok]),
                  f"{report.estimator} {'passes' if report.passed else 'fails'}")  # fmt: skip
        out.code = 0 if report.passed else FAILED
