"""The answers that come with simnav: one small JSON file for each claim, with the ratio of every seed.

``python -m simnav.leaderboard.papers.claims.stored [--judgement] [CLAIM...]`` computes them anew, all or those that are
named, and keeps the runs in ``results/claims``. With ``--judgement`` values that the stored search has are not searched
again. A page needs these files only.
"""

from __future__ import annotations

import json
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from .answer import Answer

__all__ = ["FOLDER", "answers_of", "computed_on", "read", "save"]

#: Where the files are.
FOLDER = Path(__file__).with_name("results")
_FORMAT = 2


def save(answer: Answer, folder: Path = FOLDER) -> Path:
    """Write an answer; returns the path of the file."""
    from simnav.leaderboard.results.files import write_whole

    about = {"format": _FORMAT, "simnav": version("simnav"), "date": datetime.now(UTC).strftime("%Y-%m-%d")}
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps({**about, **answer.to_dict()}, indent=1, allow_nan=True)
    return write_whole(folder / f"{answer.claim}.json", text + "\n")


def read(name: str, folder: Path = FOLDER) -> Answer | None:
    """The stored answer of a claim; None if there is none.

    Raises
    ------
    ValueError
        If the file is damaged; one sentence.
    """
    found = _document(name, folder)
    if found is None:
        return None
    try:
        return Answer.from_dict(found)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{folder / name}.json is damaged: {error}") from None


def computed_on(name: str, folder: Path = FOLDER) -> str:
    """Day and version of simnav of a stored answer; empty if there is none."""
    found = _document(name, folder)
    return "" if found is None else f"{found['date']} with simnav {found['simnav']}"


def answers_of(paper: str, folder: Path = FOLDER) -> list[Answer]:
    """The stored answers of a paper's claims, in their order; of a claim that has changed since there is none."""
    from .declared import claims_of

    found = []
    for claim in claims_of(paper):
        answer = read(claim.name, folder)
        if answer is not None and (answer.gain, answer.sentence) == (claim.gain, claim.sentence):
            found.append(answer)
    return found


def _document(name: str, folder: Path) -> dict[str, object] | None:
    path = folder / f"{name}.json"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except ValueError as error:
        raise ValueError(f"{path} is damaged: {error}") from None
    if not isinstance(found, dict) or found.get("format") != _FORMAT:
        raise ValueError(f"{path} is not an answer of format {_FORMAT}")
    return found


def main() -> None:
    """The command of the module."""
    import argparse

    from .declared import CLAIMS, claim_of
    from .search import search

    parser = argparse.ArgumentParser(prog="python -m simnav.leaderboard.papers.claims.stored")
    parser.add_argument("claims", nargs="*", metavar="CLAIM", help="default: all")
    parser.add_argument("--judgement", action="store_true", help="do not search again what the stored answer has")
    parser.add_argument("--runs", type=int, default=6, help="seeds of the search")
    parser.add_argument("--judged", type=int, default=12, help="first number of seeds of the judgement")
    parser.add_argument("--output", type=Path, default=Path("results") / "claims", help="folder of the runs")
    given = parser.parse_args()
    for claim in [claim_of(name) for name in given.claims] or CLAIMS:
        known = read(claim.name) if given.judgement else None
        made = search(claim, claim.dials, given.output, runs=given.runs, judged=given.judged, known=known)
        print(f"{claim.name}: {made.sentence_of_verdict} ({save(made)})", flush=True)


if __name__ == "__main__":
    main()
