"""The contract of every row: all checks of `simnav check`. The tests do all of them for one row of each sort."""

from __future__ import annotations

from collections.abc import Iterator

from simnav.estimator import names
from simnav.testing.contract_check import check


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """One row of the table: how many rows keep the contract, and what those do not keep that do not."""
    reports = [check(name) for name in names()]
    failed = [f"{r.estimator}: {f.name}" for r in reports for f in r.findings if not f.ok]
    yield "rows that keep the contract", f"{sum(r.passed for r in reports)} of {len(reports)}", "all", not failed
    for text in failed:
        yield "a check that fails", text, "none", False
