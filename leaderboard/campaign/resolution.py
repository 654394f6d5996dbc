"""From what was asked for to an estimator that takes part: found, looked at where it can do no harm, and digested."""

from __future__ import annotations

import contextlib
import importlib
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from simnav.estimator import EstimatorError, find
from simnav.estimator.looking_back import inner_of
from simnav.estimator.needs import Needs, NeedsError, checked_needs
from simnav.estimator.registry import is_own_reference, point_of
from simnav.leaderboard.campaign.confinement.attempt import describe, prepare
from simnav.leaderboard.campaign.confinement.isolation import isolate
from simnav.leaderboard.campaign.confinement.session import Limits
from simnav.leaderboard.results.errors import RequestError, mistakes

from .entrant import Entrant
from .fingerprint import (
    digest,
    estimator_source,
    named_files,
    own_code,
    variant,
    with_library,
)
from .request import EstimatorRequest, comes_with_simnav, file_of
from .session_class import is_session, pickle_class
from .training_runs import declared_ranges, ranges_of, record_of

__all__ = ["own_files", "resolve", "variant_of"]

_IMPORT_TIME = 60.0  # for importing and describing an estimator [s]
_MEMORY = 2 << 30  # likewise [bytes]


def resolve(request: EstimatorRequest, confinement: str, hidden: Sequence[Path]) -> Entrant:
    """Find an estimator and look at it: one of others in a process of its own, for importing a file runs it."""
    name, source = request.name, ""
    file = file_of(name)
    parameters = {key: _absolute(value) for key, value in request.parameters.items()}
    if file:
        name = f"{Path(file).resolve()}{name.removeprefix(file)}"
        entrant = Entrant(name, parameters, request.label, False, "")
    elif request.point:
        if confinement == "none":
            raise RequestError(f"estimator {request.name!r}: a package that is not trusted is not run unconfined")
        entrant = Entrant(name, parameters, request.label, False, "", point=request.point, search=request.search)
    else:
        with contextlib.suppress(ImportError):  # ours, once here, so that forked processes need not do it
            importlib.import_module("simnav.estimators")
        with mistakes(EstimatorError):
            cls = request.cls or find(name)
        entrant = Entrant(name, parameters, request.label, False, "", point=point_of(cls.name))
        if comes_with_simnav(cls):
            with mistakes(EstimatorError):
                made = request.make()
            told = declared_ranges(made)
            return replace(
                entrant, reference=is_own_reference(cls.name), source=estimator_source(cls),
                learned_from=ranges_of(told), learned=record_of(told), version=cls.version, kernels=(cls.__module__,),
            )  # fmt: skip
        with contextlib.suppress(Exception):  # the other process says what is wrong
            source = estimator_source(cls)  # here, where the text of a session is known
        if request.cls is not None or is_session(cls.__module__):
            entrant = replace(entrant, code=pickle_class(cls))
    if confinement == "none":
        outcome = isolate(_describe, entrant, timeout=_IMPORT_TIME, memory=_MEMORY)
        found, why = outcome.value, outcome.reason
    else:
        try:
            server = prepare(confinement, hidden, loaded=())
            found, why = describe(server, entrant, Limits(_IMPORT_TIME, _MEMORY)), ""
        except ValueError as error:
            found, why = None, str(error)
    if found is None:
        reason = re.sub(r"^(Estimator|Request)Error: ", "", why)
        told = any(name in reason for name in (request.name, repr(request.label.partition("(")[0])))
        raise RequestError(reason if told else f"estimator {request.name!r}: {reason}")
    if found["reference"]:
        raise RequestError(
            f"estimator {request.name!r} declares itself a reference; in a campaign only simnav's own references are "
            "told the truth"
        )
    try:
        learned_from, learned = ranges_of(found["learned_from"]), record_of(found["learned_from"])
    except ValueError as error:
        raise RequestError(f"estimator {request.name!r}: {error}") from None
    return replace(
        entrant, source=source or with_library(found["source"]), learned_from=learned_from, learned=learned,
        version=found["version"], own=found["source"], kernels=tuple(found.get("kernels", ("simnav",))),
        needs=_needs(found["needs"]),
    )  # fmt: skip


def _absolute(value: Any) -> Any:
    """A parameter; the name of a file as an absolute path, for estimators run in another folder."""
    if isinstance(value, (str, Path)) and re.search(r"[/.\\]", str(value)) and named_files([value]):
        return str(Path(value).expanduser().resolve())
    return value


def _describe(entrant: Entrant) -> dict[str, Any]:
    """In the isolated process: what `simnav.leaderboard.campaign.confinement.attempt.describe` gives."""
    made = entrant.make()
    cls = type(inner_of(made))
    return {
        "reference": cls.reference, "source": own_code(cls), "learned_from": declared_ranges(made),
        "version": cls.version, "needs": made.needs,
    }  # fmt: skip


def _needs(told: object) -> Needs:
    """What an estimator says that it needs; none where that cannot be read: each run says so."""
    with contextlib.suppress(NeedsError):
        return checked_needs(told)
    return ()


def variant_of(entrant: Entrant, recording: str) -> str:
    """The key of an estimator's results without the seed: of a file the name counts, not the folder."""
    return variant(recording, entrant.label, os.path.basename(entrant.name), entrant.parameters, entrant.source)


def own_files(entrant: Entrant) -> str:
    """Digest of the files of an estimator of others, with those that its parameters name; empty for one of simnav."""
    if not entrant.own:
        return ""
    return digest(entrant.own, *(content for _, content in named_files(entrant.parameters.values())))
