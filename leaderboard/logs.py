"""Calls for logs, and for estimates that were made elsewhere. `simnav.leaderboard.interface` has these calls, too."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.results.errors import RequestError, mistakes

from .arguments import absolute, require_folder, scenario_of, scenarios_of
from .calls import call, finite_number, whole_number
from .log_requests import (
    AlignRequest,
    ExportRequest,
    IdentifyRequest,
    InspectRequest,
    RecordingsRequest,
    ScoreRequest,
    TuneNoiseRequest,
    TwinRequest,
)

if TYPE_CHECKING:
    from simnav.log.alignment import Alignment
    from simnav.log.noise_figures import Figure
    from simnav.scenario import Scenario

    from .identification.report import Identification
    from .identification.twin import Twin
    from .log_inspection import Inspection
    from .recordings import PublicRecordings
    from .single_run import ScoreReport

__all__ = ["align", "export", "identify", "inspect_log", "recordings", "score_files", "tune_noise", "twin"]


@call(ScoreRequest)
def score_files(request: ScoreRequest) -> ScoreReport:
    """Score estimates that were made elsewhere.

    Returns
    -------
    ScoreReport
        As of a run, with errors after an alignment and relative ones; the estimators are the files, by their names.

    Raises
    ------
    RequestError
        If a file cannot be read: one sentence with file, line and column.
    """
    from simnav.leaderboard.campaign.seal import read_seal

    from .single_run import score_of_files

    given = [request.files] if isinstance(request.files, (str, os.PathLike)) else list(request.files)
    if not given:
        raise RequestError("no file of estimates was named")
    chosen, number = scenario_of(request.scenario), whole_number("seed", request.seed, 0)
    seed = read_seal(request.sealed).seed(chosen.id, number)
    return score_of_files(chosen, [absolute(path) for path in given], seed)


@call(ExportRequest)
def export(request: ExportRequest) -> list[Path]:
    """Write what an estimator receives.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    RequestError
        If the format is unknown or needs the truth, or options contradict each other.
    """
    from simnav.leaderboard.campaign.seal import read_seal
    from simnav.source import record

    from .results.formats import formats, write
    from .results.hidden import without_truth

    seal, chosen = read_seal(request.sealed), scenarios_of(request.scenarios)
    if request.blind and request.truth:
        raise RequestError("'blind' and 'truth' exclude each other")
    if request.blind and not seal.secret:
        raise RequestError(
            "'blind' needs 'sealed': without a key anybody can make the runs; 'simnav campaign seal KEYFILE' makes one"
        )
    if request.form not in formats("recording"):
        raise RequestError(f"format = {request.form!r} is unknown; there are: {', '.join(formats('recording'))}")
    output, runs = absolute(request.output), whole_number("runs", request.runs, 1)
    first, written = whole_number("seed", request.seed, 0), list[Path]()
    for scenario in chosen:
        for number in range(first, first + runs):
            with mistakes(ValueError, OSError):
                recording = record(scenario, seal.seed(scenario.id, number))
                told = recording if request.truth else without_truth(recording)
                if not seal.secret:  # who has the scenario and the seed can make the run again, as it was asked for
                    told = replace(told, seed=recording.seed)
                several = runs > 1 or len(chosen) > 1 or request.blind
                ending = "" if request.form == "csv" else f".{request.form}"
                target = output / f"{scenario.id}-{number}{ending}" if several else output
                target.parent.mkdir(parents=True, exist_ok=True)
                written += write("recording", request.form, told, target)
    return written


@call(InspectRequest)
def inspect_log(request: InspectRequest) -> Inspection:
    """What the files of a log hold.

    Returns
    -------
    Inspection
        The streams, and a sentence for each file that cannot be read; with ``output`` or ``run`` also a scenario to
        begin with, what a person must add to it, and the first run.

    Raises
    ------
    RequestError
        If a file does not exist, or the scenario cannot be written.
    """
    from simnav.log.inspection import inspect_log
    from simnav.log.table import LogError

    from .log_inspection import Inspection, drafted, first_run
    from .results.files import write_whole

    given = [request.files] if isinstance(request.files, (str, os.PathLike)) else list(request.files)
    target = None if request.output is None else absolute(request.output)
    if target is not None and target.suffix != ".toml":
        raise RequestError(f"output = {request.output}: the file should end in .toml")
    with mistakes(ValueError, OSError):
        streams, failed = inspect_log([absolute(path) for path in given])
        found = Inspection(tuple(streams), tuple(failed))
        if not streams or (target is None and not request.run):
            return found
        named = target.stem if target is not None else absolute(given[0]).stem
        name = _scenario_name(named)
        made = drafted(streams, name, f"{name}.toml" if target is None else target.name)
        if target is not None:
            write_whole(target, made.text)
        found = replace(found, draft=made.text, readings=made.readings, missing=made.missing)
        if not request.run or made.scenario is None:
            return found
        try:
            return replace(found, run=first_run(made.scenario, request.progress))
        except LogError as error:
            return replace(found, missing=str(error))


@call(AlignRequest)
def align(request: AlignRequest) -> list[Alignment]:
    """Delays, lever arms, offsets and scales of the instruments of a log, by comparison with its reference.

    Returns
    -------
    list of simnav.log.alignment.Alignment

    Raises
    ------
    RequestError
        If the scenario has no log, or the log cannot be used.
    """
    from simnav.log.alignment import align

    scenario = _recorded(request.scenario)
    with mistakes(ValueError, OSError):
        return align(scenario, whole_number("seed", request.seed, 0))


@call(RecordingsRequest)
def recordings(request: RecordingsRequest) -> list[PublicRecordings]:
    """Public recordings of real voyages, and the scenarios that their downloaded files give.

    Returns
    -------
    list of simnav.leaderboard.recordings.PublicRecordings

    Raises
    ------
    RequestError
        If there is no such scenario or file, or no file is one of a recording.
    """
    from .recordings import public_recordings, take

    given = [request.files] if isinstance(request.files, (str, os.PathLike)) else list(request.files or ())
    asked = request.scenarios or ()
    names = [n.strip() for n in asked.split(",")] if isinstance(asked, str) else list(asked)
    output = None if request.output is None else absolute(request.output)
    if not given:
        return public_recordings(names, output)
    root = absolute(os.environ.get("SIMNAV_DATA", "data")) if output is None else output
    with mistakes(OSError):
        return take([absolute(path) for path in given], root, names)


@call(TuneNoiseRequest)
def tune_noise(request: TuneNoiseRequest) -> list[Figure]:
    """Noise figures for the datasheets of a log.

    Returns
    -------
    list of simnav.log.noise_figures.Figure

    Raises
    ------
    RequestError
        If the scenario has no log, or the log cannot be used.
    """
    from simnav.log.alignment import align
    from simnav.log.noise_figures import noise_figures

    from .white_innovations import innovation_figures

    scenario, seed = _recorded(request.scenario), whole_number("seed", request.seed, 0)
    with mistakes(ValueError, OSError):
        found = noise_figures(scenario, align(scenario, seed), seed)
        return found + innovation_figures(scenario, seed) if request.innovations else found


@call(IdentifyRequest)
def identify(request: IdentifyRequest) -> Identification:
    """Fit the error model of a log's instruments.

    Returns
    -------
    simnav.leaderboard.identification.report.Identification
        Estimates with 95 % intervals, what the log does not tell, innovations before and after, and the scenario with
        the datasheets to use.

    Raises
    ------
    RequestError
        If the log cannot be used, or a filter cannot run on it.
    """
    from simnav.source import record

    from .identification.report import identify

    scenario, seed = scenario_of(request.scenario), whole_number("seed", request.seed, 0)
    until = _until(request.until)
    with mistakes(ValueError, OSError):
        return identify(scenario.drawn(seed), record(scenario, seed), until)


@call(TwinRequest)
def twin(request: TwinRequest) -> Twin:
    """Write a scenario of simulated voyages with the track of a log and the errors that were found in it.

    Returns
    -------
    simnav.leaderboard.identification.twin.Twin
        The scenario, its track, and which instruments have errors that were fitted to a reference.

    Raises
    ------
    RequestError
        If the log cannot be used, or the output is no TOML file.
    """
    from simnav.source import record

    from .identification.report import identify
    from .identification.twin import twin_of

    scenario, seed = scenario_of(request.scenario), whole_number("seed", request.seed, 0)
    until = _until(request.until)
    target = absolute(request.output or f"{scenario.name}-twin.toml")
    if target.suffix != ".toml":
        raise RequestError(f"output = {request.output}: the file should end in .toml")
    require_folder(f"output = {request.output}", target)
    with mistakes(ValueError, OSError):
        drawn = scenario.drawn(seed)
        recording = record(drawn.model_copy(update={"faults": ()}), seed)
        return twin_of(drawn, recording, identify(drawn, recording, until)).save(target)


def _until(given: float | None) -> float | None:
    until = None if given is None else finite_number("until", given)
    if until is not None and until <= 0.0:
        raise RequestError(f"until = {until:g}: it should be a time of the log above 0 s")
    return until


def _recorded(given: str | Path | Scenario) -> Scenario:
    scenario = scenario_of(given)
    if scenario.log is None:
        raise RequestError(f"{scenario.id} has no [log]: it is simulated, and there is nothing to compare")
    return scenario


def _scenario_name(file: str) -> str:
    """A name in kebab-case and without a version, from that of a file.

    >>> _scenario_name("Trip 2024"), _scenario_name("2024-05-01"), _scenario_name("Trip_v2"), _scenario_name("_")
    ('trip-2024', 'log-2024-05-01', 'trip-v2-log', 'my-log')
    """
    words = "".join(c if c.isascii() and c.isalnum() else " " for c in file.lower()).split()
    name = "-".join(words) or "my-log"
    name = name if name[0].isalpha() else f"log-{name}"
    return f"{name}-log" if re.search(r"-v\d+$", name) else name
