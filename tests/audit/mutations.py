"""Mutated files of every format of logs: a reader reads them, or refuses them with one sentence; none hangs."""

from __future__ import annotations

import json
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
from simnav.log.inspection import inspect_log, track_of
from simnav.satellites.rinex_navigation import NavigationFileError
from tests.cases.log_files import CASES, OTHERS, damaged, read

__all__ = ["mutations", "parts", "rows"]

#: Mutated files of each format.
FILES = 3000
#: No file of a case may take longer [s].
_PATIENCE = 10


def mutations(form: str, number: int, seed: int = 0) -> Counter[str]:
    """How many mutated files of a format were read, refused with one sentence, or ended in something else.

    Each is also looked at as by ``simnav log inspect``; only what should not happen there is counted.
    """
    found: Counter[str] = Counter()
    case = CASES.get(form) or OTHERS[form]

    def hangs(*_: object) -> None:
        raise TimeoutError("hangs")

    before = signal.signal(signal.SIGALRM, hangs)
    try:
        with tempfile.TemporaryDirectory() as folder:
            good = Path(folder) / f"good{case.ending}"
            case.make(good)
            content = good.read_bytes()
            for k in range(number):
                path = Path(folder) / f"{k}{case.ending}"
                damaged(case, path, content, random.Random(f"{form}/{seed}/{k}"))
                found[_outcome(partial(case.reads or partial(_rows, form), path), k)] += 1
                if case.reads is None:
                    looked = _outcome(partial(_look, path), k)
                    if looked not in ("read", "refused"):
                        found[f"inspect: {looked}"] += 1
                path.unlink()
    finally:
        signal.signal(signal.SIGALRM, before)
    return found


def _rows(form: str, path: Path) -> Any:
    return read(form, path).table


def _look(path: Path) -> Any:
    streams, failed = inspect_log([path])
    if failed:
        raise LogError(failed[0])
    for stream in streams:
        json.dumps(stream.to_dict())
        track_of(stream)
    return streams or "no stream"  # a bag without messages


def _outcome(what: Callable[[], Any], k: int) -> str:
    """``read``, ``refused``, or what is wrong with case k."""
    signal.alarm(_PATIENCE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return "read" if len(what()) else f"empty (case {k})"
    except (LogError, NavigationFileError) as error:
        text = str(error)
        own = ": reader " in text and " in " in text and "line" in text  # an exception of the code of a reader
        good_sentence = "\n" not in text and len(text) < 1000 and not own
        return "refused" if good_sentence else f"no sentence (case {k}): {text[:200]}"
    except BaseException as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return f"traceback (case {k}): {type(error).__name__} at {Path(place.filename).name}:{place.lineno}"
    finally:
        signal.alarm(0)


def parts() -> Mapping[str, Callable[[], Any]]:
    """One part for each format, and for further contents of some."""
    return {form: partial(mutations, form, FILES) for form in [*CASES, *OTHERS]}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """A row for each format."""
    for form, counts in found.items():
        bad = [what for what in counts if what not in ("read", "refused")]
        figure = f"{counts.get('read', 0)} read, {counts.get('refused', 0)} refused"
        yield f"{form}: {FILES} mutated files", "; ".join([figure, *bad])[:200], "no traceback, no hang", not bad
