"""``simnav paper reproduce``: the comparison of a paper, repeated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from simnav.leaderboard.inspection import reproduce
from simnav.leaderboard.papers import figures, page, report
from simnav.leaderboard.papers.claims.points import gain_text
from simnav.leaderboard.papers.comparison import RULES
from simnav.leaderboard.requests import ReproduceRequest

from .console import Output
from .options import absolute, campaign_progress

__all__ = ["show"]


def show(out: Output, request: ReproduceRequest) -> None:
    """Repeat the comparison of a paper: our figures beside the paper's, with a verdict on each row."""
    with out.progress("starting") as bar:
        found = reproduce.of(replace(request, progress=lambda scenario, p: campaign_progress(bar, scenario)(p)))
    about = found.paper
    folder = absolute(request.output or Path("reproduced") / about.key)
    folder.mkdir(parents=True, exist_ok=True)
    table = report.write_csv(found, folder / f"paper-{about.key}.csv")
    with out.progress("drawing") as bar:
        drawn = figures.write_figures(
            found,
            folder,
            lambda done, total, note: bar(done, total, note=note),
            scores_only=request.stored or request.holds_if,
        )
    written = page.write(found, drawn, folder)
    paths = [d.path for d in drawn if d.path is not None]
    out.document({**found.to_dict(), "contents": report.whereabouts(found, drawn), "csv": str(table),
                  "page": str(written), "figures": [str(p) for p in paths]})  # fmt: skip
    out.print(f"{about.short}: {about.about}", f"{about.citation}\n")
    out.print(*report.paper_tables(found), report.contents_table(found, drawn))
    for note in about.notes:
        out.print(f"note: {note}")
    out.print(f"rule: {RULES}", report.summary(found))
    for answer in found.answers or []:
        out.print(f"claim: {answer.sentence}", *answer.shown())
        out.print(f"with our settings: {gain_text(answer.ours)}: {answer.standing}",
                  f"verdict: {answer.sentence_of_verdict}")  # fmt: skip
    if found.count("undecided") and not (request.stored or request.holds_if):
        out.print(f"more runs for undecided rows: simnav paper reproduce {about.key} --until-decided")
    out.print(f"table:   {table}", f"figures: {len(paths)} as PNG in {folder}", f"page:    {written}")
