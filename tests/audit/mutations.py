"""Mutated files of every format of logs: a reader reads them, or refuses them with one sentence; none hangs."""

from __future__ import annotations

import random
import signal
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from simnav.log import LogError
from tests.cases.log_files import CASES, mutated, read

__all__ = ["mutations", "parts", "rows"]

#: Mutated files of each format.
FILES = 3000
#: No file of a case may take longer [s].
_PATIENCE = 10


def mutations(form: str, number: int, seed: int = 0) -> Counter[str]:
    """How many mutated files of a format were read, refused with one sentence, or ended in something else."""
    found: Counter[str] = Counter()

    def hangs(*_: object) -> None:
        raise TimeoutError("hangs")

    before = signal.signal(signal.SIGALRM, hangs)
    try:
        with tempfile.TemporaryDirectory() as folder:
            good = Path(folder) / f"good{CASES[form].ending}"
            CASES[form].make(good)
            content = good.read_bytes()
            for k in range(number):
                path = Path(folder) / f"{k}{CASES[form].ending}"
                path.write_bytes(mutated(content, random.Random(f"{form}/{seed}/{k}")))
                signal.alarm(_PATIENCE)
                try:
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")
                        found["read" if len(read(form, path).table) else "empty"] += 1
                except LogError as error:
                    text = str(error)
                    own = (
                        ": reader " in text and " in " in text and "line" in text
                    )  # an exception of the code of a reader
                    good_sentence = "\n" not in text and len(text) < 1000 and not own
                    found["refused" if good_sentence else f"no sentence (case {k}): {text[:200]}"] += 1
                except BaseException as error:
                    place = traceback.extract_tb(error.__traceback__)[-1]
                    found[
                        f"traceback (case {k}): {type(error).__name__} at {Path(place.filename).name}:{place.lineno}"
                    ] += 1
                finally:
                    signal.alarm(0)
                path.unlink()
    finally:
        signal.signal(signal.SIGALRM, before)
    return found


def parts() -> Mapping[str, Callable[[], Any]]:
    """One part for each format."""
    return {form: partial(mutations, form, FILES) for form in CASES}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """A row for each format."""
    for form, counts in found.items():
        bad = [what for what in counts if what not in ("read", "refused")]
        figure = f"{counts.get('read', 0)} read, {counts.get('refused', 0)} refused"
        yield f"{form}: {FILES} mutated files", "; ".join([figure, *bad])[:200], "no traceback, no hang", not bad
