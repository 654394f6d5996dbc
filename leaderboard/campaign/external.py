"""Estimates that were made elsewhere, as results of a campaign: files in a folder, marked *external*.

They are scored like others. They were not confined, so nobody knows what their makers saw, and have no cost.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.result import EXTERNAL
from simnav.log import LogError
from simnav.scenario import Scenario
from simnav.trial.estimate_file import ENDINGS, trial_of_file

from .confinement.attempt import Attempt
from .confinement.session import Limits
from .entrant import Entrant
from .fingerprint import recording_digest, simulator_version
from .own_scores import own_scores, scoring_code
from .recorder import NoRecordingError, record_within, time_limit
from .resolution import variant_of
from .seal import PUBLIC, Seal
from .sources import digest
from .worker import Unit, judged

__all__ = ["add_external", "external_files"]


def external_files(folder: Path, scenarios: Sequence[Scenario], numbers: Sequence[int]) -> dict[str, dict[str, Path]]:
    """The files of a folder: name of a row -> ``SCENARIO-RUN`` -> file.

    Raises
    ------
    RequestError
        If there is none, two files are of one run, or a row lacks runs that were asked for.
    """
    if not folder.is_dir():
        raise RequestError(f"--external {folder}: there is no such folder")
    wanted = [f"{s.id}-{number}" for s in scenarios for number in numbers]
    found: dict[str, dict[str, Path]] = {}
    for home in sorted(p for p in folder.iterdir() if p.is_dir()):
        files: dict[str, Path] = {}
        for path in sorted(home.iterdir()):
            if path.suffix.lower() not in ENDINGS:
                continue
            if path.stem in files:
                raise RequestError(f"{path} and {files[path.stem].name} are of the same run; leave one of them")
            files[path.stem] = path
        missing = [name for name in wanted if name not in files]
        if len(missing) == len(wanted):
            raise RequestError(
                f"{home} has no file of the runs of this campaign; files are named like {wanted[0]}.csv or .tum"
            )
        if missing:
            raise RequestError(f"{home} lacks {len(missing)} of {len(wanted)} runs, such as {missing[0]}.csv")
        found[home.name] = {name: files[name] for name in wanted}
    if not found:
        raise RequestError(
            f"--external {folder}: there is no folder in it; wanted are files like my-filter/{wanted[0]}.csv"
        )
    return found


def add_external(
    folder: Path,
    external: Path,
    scenarios: Sequence[Scenario],
    numbers: Sequence[int],
    seal: Seal = PUBLIC,
    progress: Callable[[str], None] | None = None,
) -> list[str]:
    """Score the files of a folder, and store the results beside those of a campaign.

    Parameters
    ----------
    folder : Path
        Folder of results.
    external : Path
        Folder of files, ``NAME/SCENARIO-RUN.csv``.
    scenarios, numbers : sequence
        What the campaign runs.
    seal : Seal
        How seeds follow from the numbers of the runs.
    progress : callable, optional
        Called with the run that is scored.

    Returns
    -------
    list of str
        Labels of the rows.

    Raises
    ------
    RequestError
        If a file is missing. A file that cannot be read is a failed run, with the reason.
    """
    files, simulator, scoring = external_files(external, scenarios, numbers), simulator_version(), scoring_code()
    rows = [
        Entrant(
            name, {}, f"{name}{EXTERNAL}", False, digest(*(path.read_bytes().hex() for path in of.values())), own=name
        )
        for name, of in files.items()
    ]
    for scenario in scenarios:
        recorded = seal.recording(recording_digest(scenario, simulator))
        variants = {row.label: variant_of(row, recorded) for row in rows}
        store.select(folder, {scenario.id: (recorded, variants)})
        for number in numbers:
            run = f"{scenario.id}-{number}"
            if progress is not None:
                progress(run)
            keys = tuple((row, f"{variants[row.label]}-{number}") for row in rows)
            limits = Limits(time_limit(scenario), 1)
            unit = Unit(
                scenario, number, keys, recorded, simulator, folder, limits, own_scores(), scoring,
                confinement="none", seal=seal,
            )  # fmt: skip
            try:
                recording = record_within(scenario, seal.seed(scenario.id, number), time_limit(scenario))
            except NoRecordingError as error:
                raise RequestError(f"{run} cannot be recorded: {error}") from None
            for row, key in keys:
                try:
                    trial = trial_of_file(files[row.name][run], recording, row.name)
                    made = Attempt(trial.status, trial.reason, trial, 0.0, 0, "external")
                except LogError as error:
                    made = Attempt("invalid-output", str(error), None, 0.0, 0, "external")
                result = judged(unit, row, key, recording, made)
                store.write(folder, replace(result, note=f"external; {result.note}".rstrip("; ")))
    store.compact(folder)
    return [row.label for row in rows]
