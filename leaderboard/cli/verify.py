"""``simnav campaign verify``: seals, submissions, and a sample of results that is repeated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.comparison import CLOSE
from simnav.leaderboard.inspection import verify
from simnav.leaderboard.publishing import verify_bundle
from simnav.leaderboard.publishing_requests import VerifyBundleRequest

from .commands import VerifyCommand
from .console import CLAIMED, FAILED, Output
from .options import absolute

if TYPE_CHECKING:
    from simnav.leaderboard.submission.verifying import SubmissionReport

__all__ = ["show"]


def show(out: Output, request: VerifyCommand) -> None:
    """Check results or a submission, and repeat some of the runs, bit for bit.

    The exit code is 0 if all holds, 3 if nothing speaks against it but something cannot be checked here, 1 otherwise.
    """
    if absolute(request.results).is_file():
        bundle = VerifyBundleRequest(
            request.results, key=request.key, sample=request.sample, present=request.present,
            tolerance=request.tolerance,
        )  # fmt: skip
        with out.progress("repeating") as progress:
            facts = verify_bundle.of(replace(bundle, progress=progress))
        _print(out, facts)
        return
    with out.progress("repeating") as progress:
        done = verify.of(replace(request, progress=progress))
    out.document(done.to_dict())
    seal = f"sealed by {done.seal}" if done.seal else "public seeds"
    lines = [f"results: {done.folder} ({done.results}, {seal})"]
    if done.other_seals:
        lines.append(f"{done.other_seals} results were not made under this key")
    lines += [f"set aside: {text}" for text in done.set_aside]
    lines += [f"different: {text}" for text in (*done.different, *done.claims)]
    lines += [f"close: {text}" for text in done.close]
    lines += [f"not repeatable: {text}" for text in done.not_repeatable]
    lines += [f"cannot be checked here: {text}" for text in done.not_here]
    lines += [f"incomplete: {text}" for text in done.missing]
    lines += [f"not confirmed: {text}" for text in done.unconfirmed]
    if done.unknown:
        lines.append(f"{_unknown(done.unknown)} ('simnav --plugin FILE campaign verify ...' loads a file of scores)")
    same = done.same
    more = f", {len(done.close)} more within {CLOSE:.0e}" if done.close else ""
    lines.append(f"{same} of {done.repeated} repeated runs are the same to the bit{more}")
    lines += [done.finds, done.summary]
    out.print(*lines)
    out.code = _code(not done.refuted, (*done.not_here, *done.unconfirmed_fields))


def _code(passed: bool, unconfirmed: Sequence[str]) -> int:
    """Exit code: a script learns whether something is left that only the results say."""
    return (CLAIMED if unconfirmed else 0) if passed else FAILED


def _unknown(scores: Sequence[str]) -> str:
    return f"not known here: {', '.join(scores)}"


def _print(out: Output, report: SubmissionReport) -> None:
    out.document(report.to_dict())
    lines = [
        f"bundle:  {report.title}: {', '.join(report.estimators)} ({report.results} results, profile {report.profile})",
        f"sha256:  {report.digest}",
        f"where:   {report.environment}",
        *(f"finding: {text}" for text in report.findings),
        *(f"differs: {text}" for text in report.different),
        *(f"not confirmed: {text}" for text in (*report.undecided, *report.unconfirmed)),
    ]
    for s in report.sealed:
        worse = "worse than public" if s in report.worse else "not worse than public"
        lines.append(
            f"sealed:  {s.label} on {s.scenario}: {worse}, {s.ratio:.3g} times the median error, p = {s.p_value:.2g} "
            f"({s.sealed} sealed and {s.public} public runs, {s.failed} sealed runs failed)"
        )
    if report.unknown:
        lines.append(_unknown(report.unknown))
    lines.append(
        f"{report.identical} of {report.repeated} repeated runs are the same to the bit, {report.close} more within "
        f"{report.tolerance:.0e}"
    )
    lines += [report.finds, report.summary]
    lines.append("the submission holds" if report.passed else "the submission does not hold")
    out.print(*lines)
    out.code = _code(report.passed, report.unconfirmed_fields)
