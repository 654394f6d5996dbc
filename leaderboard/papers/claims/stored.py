"""The answers that come with simnav: one small JSON file for each claim, with the ratio of every seed.

They are what ``simnav paper claim NAME --holds-if all --json`` prints. ``python -m
simnav.leaderboard.papers.claims.stored FILE...`` takes such outputs over. A page needs these files only.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from .answer import Answer

__all__ = ["FOLDER", "answers_of", "computed_on", "read", "save"]

#: Where the files are.
FOLDER = Path(__file__).with_name("results")
_FORMAT = 3


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


def main(files: Sequence[str]) -> None:
    """The command of the module: take over the outputs of ``simnav paper claim``."""
    for file in files:
        made = Answer.from_dict(json.loads(Path(file).read_text(encoding="utf-8")))
        print(f"{made.claim}: {made.sentence_of_verdict} ({save(made)})")


if __name__ == "__main__":
    main(sys.argv[1:])
