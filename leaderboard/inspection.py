"""Calls that run no estimator of the user: rankings, bounds, scores, seals, citations, the papers' comparisons.

`simnav.leaderboard.interface` has these calls, too.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.request import Estimators, requests
from simnav.leaderboard.given import ScenarioLike, Scenarios, absolute, results_of, scenario_of, scenarios_of, whole
from simnav.leaderboard.results import requested
from simnav.leaderboard.results.errors import RequestError, StoreError, mistakes
from simnav.leaderboard.results.scratch import scratch

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress
    from simnav.leaderboard.campaign.rescoring import Rescored
    from simnav.leaderboard.campaign.seal import Seal
    from simnav.leaderboard.campaign.verification import Verification
    from simnav.leaderboard.papers.reproduction import Reproduction
    from simnav.leaderboard.ranking.board import Ranking
    from simnav.leaderboard.ranking.bounds import BoundReport
    from simnav.leaderboard.results.citation import Citation
    from simnav.leaderboard.results.result import Result

__all__ = ["bound", "cite", "merge", "rank", "reproduce", "rescore", "seal", "verify"]


def rank(
    results: str | os.PathLike[str] | Iterable[Result],
    *,
    score: str | None = None,
    tracks: Mapping[str, str] | None = None,
) -> Ranking:
    """Rank estimators by their results.

    Parameters
    ----------
    results : path or iterable of Result
        Folder that a campaign wrote, or results themselves.
    score : str, optional
        Key of `simnav.scoring.SCORES`, one that is better when lower. Default: the horizontal error, and for
        post-processing the smoothed one.
    tracks : mapping of str to str, optional
        Track of scenarios that are not in the catalogue, by versioned id.

    Returns
    -------
    simnav.leaderboard.ranking.board.Ranking

    Raises
    ------
    RequestError
        If the score is unknown or not better when lower, or no result has it.
    """
    from simnav.leaderboard.ranking.ranking import RANKED_SCORES, rank, require_lower, require_score
    from simnav.leaderboard.results.result import Result

    if score is not None:
        require_lower(score, "a ranking is by errors")
    wanted = RANKED_SCORES | ({score} if score else set())
    asked: Mapping[str, Sequence[int]] = {}
    if results is None or isinstance(results, (str, os.PathLike)):
        given = results_of(results, scores=wanted)
        asked = requested.read(results)
    else:
        given = list(results)
    if not all(isinstance(r, Result) for r in given):
        raise RequestError("a folder of results is wanted, or results; 'simnav.merge' puts several folders together")
    require_score(score, given)
    return rank(given, score=score, tracks=tracks, requested=asked)


def rescore(
    results: str | os.PathLike[str],
    scores: str | Iterable[str] = (),
    *,
    scenarios: Scenarios = None,
    key: str | os.PathLike[str] | None = None,
    progress: Callable[..., None] | None = None,
) -> Rescored:
    """Compute scores from the trials that a campaign kept; no estimator runs.

    A trial is kept in single precision, so a score that is computed again agrees to about seven digits. Therefore
    existing scores are not changed, unless they are named, or their code has changed.

    Parameters
    ----------
    results : path
        Folder that a campaign wrote with ``keep_trials``. Its results get the scores.
    scores : str or iterable of str
        Names of scores, keys of `simnav.scoring.SCORES`; default: missing scores, and scores of simnav whose code has
        changed.
    scenarios : scenarios, optional
        Scenarios that are not in the catalogue.
    key : path, optional
        File of the key, if the seeds are sealed.
    progress : callable, optional
        Called with the number of finished runs, the number of all runs, and the last run as ``note=``.

    Returns
    -------
    Rescored
    """
    from simnav.leaderboard.campaign.rescoring import rescore_results
    from simnav.leaderboard.campaign.seal import read_seal

    names = scores.split(",") if isinstance(scores, str) else [str(s) for s in scores]
    given = [] if scenarios is None else scenarios_of(scenarios)
    with mistakes(StoreError):
        return rescore_results(
            absolute(results), [n.strip() for n in names if n.strip()], given, progress,
            seal=read_seal(key, secret=False),
        )  # fmt: skip


def merge(folders: Iterable[str | os.PathLike[str]], output: str | os.PathLike[str]) -> list[Result]:
    """Put the results of several folders into one, e.g. of the shards of a campaign.

    A run that several of them hold counts once. The copy of a file that is damaged is set aside, with a warning.

    Parameters
    ----------
    folders : iterable of path
        Folders of results, one or several, which are not changed; or bundles of `simnav.submit`, which should be
        verified first.
    output : path
        A new or empty folder, or a folder of results, which are kept.

    Returns
    -------
    list of Result
        All results in the output folder.

    Raises
    ------
    RequestError
        If the folders belong to different versions of the benchmark, or if a scenario, the simulator or an estimator
        differs between them. Then the output is as it was.
    """
    from simnav.leaderboard.results.gathering import gather
    from simnav.leaderboard.submission.bundle import open_bundle

    with scratch("merge") as home, mistakes(StoreError):
        paths = [absolute(folder) for folder in ([folders] if isinstance(folders, (str, os.PathLike)) else folders)]
        if not paths:
            raise RequestError("no folder was named whose results should be merged")
        places = [open_bundle(path, home / str(k)).results if path.is_file() else path for k, path in enumerate(paths)]
        for path, place in zip(paths, places, strict=True):
            if path.is_file():  # how many seeds a submission asked says nothing of the campaigns of a board
                (place / requested.FILE).unlink(missing_ok=True)
        target = gather(absolute(output), places)
    return results_of(target)


def seal(key: str | os.PathLike[str], *, public: str = "") -> Seal:
    """Make or check the key of sealed seeds, for the commitment that is published before a campaign.

    Parameters
    ----------
    key : path
        File of the key. One that does not exist is made, with 256 random bits; one that exists should be readable by
        its owner only, and hold what was drawn at random.
    public : str
        A value that nobody can choose and everybody can look up, such as the numbers of a lottery that were drawn after
        the commitment was published. The seeds then follow from the key and from this value. It is stored in the file.

    Returns
    -------
    simnav.leaderboard.campaign.seal.Seal
        Its ``commitment`` is to be published before the campaign. Its ``hash`` stands in the results: the same without
        a public value.

    Raises
    ------
    RequestError
        If the key is no secret, or has another public value already.
    """
    from simnav.leaderboard.campaign.seal import make_key, mix_public, read_seal

    file = absolute(key)
    made = read_seal(file) if file.exists() else make_key(file)
    return mix_public(file, public) if public else made


def cite(results: str | os.PathLike[str] | None = None) -> Citation:
    """How to cite this version of simnav, or results.

    Parameters
    ----------
    results : path, optional
        Folder that a campaign wrote; default: simnav itself.

    Returns
    -------
    Citation

    Examples
    --------
    >>> print(cite().bibtex.splitlines()[0])
    @software{simnav,
    """
    from simnav.leaderboard.results.citation import citation

    return citation(None if results is None else [r.provenance for r in results_of(results)])


def bound(
    scenario: ScenarioLike,
    *,
    runs: int = 12,
    smoothed: bool = False,
    progress: Callable[..., None] | None = None,
) -> BoundReport:
    """The posterior Cramer-Rao bound of a simulated scenario: a lower limit of the error.

    Parameters
    ----------
    scenario : str, Path or Scenario
        Name, file or the scenario itself.
    runs : int
        Seeds over which it is averaged.
    smoothed : bool
        True: the bound of smoothed output; False: of real-time output.
    progress : callable, optional
        Called with the number of finished kinds, the number of all kinds, and the next one as ``note=``.

    Returns
    -------
    BoundReport
    """
    from simnav.leaderboard.ranking.bounds import bounds_of

    return bounds_of(scenario_of(scenario), whole("runs", runs, 1), smoothed, progress)


def verify(
    results: str | os.PathLike[str],
    *,
    key: str | os.PathLike[str] | None = None,
    sample: int | None = None,
    scenarios: Scenarios = None,
    estimators: Estimators = None,
    rows: str | Iterable[str] = (),
    progress: Callable[..., None] | None = None,
) -> Verification:
    """Check the seal of results, and repeat a sample of them, which should be equal bit for bit.

    Repeated are runs of every status. Scenarios come from the catalogue or from ``scenarios``, estimators from the
    registry or from ``estimators``, and nothing that a result names is imported.

    Parameters
    ----------
    results : path
        Folder that a campaign wrote.
    key : path, optional
        Published key of a sealed campaign.
    sample : int, optional
        Largest number of runs that are repeated; default: so many that 5 % of forged ones are found with 95 %
        probability (about 59).
    scenarios, estimators : optional
        Scenarios that are not in the catalogue, and estimators that are not registered.
    rows : str or iterable of str
        Labels of the rows of which the sample is drawn; default: all.
    progress : callable, optional
        Called with the number of finished runs, the number of all runs, and the next run as ``note=``.

    Returns
    -------
    Verification
    """
    from simnav.leaderboard.campaign.seal import read_seal
    from simnav.leaderboard.campaign.verification import verify_results

    given = [] if scenarios is None else scenarios_of(scenarios)
    with mistakes(StoreError):
        return verify_results(
            absolute(results), read_seal(key, secret=False), scenarios=given,
            sample=None if sample is None else whole("sample", sample, 1),
            estimators=requests(estimators) if estimators else [],
            rows=[rows] if isinstance(rows, str) else list(rows), progress=progress,
        )  # fmt: skip


def reproduce(
    paper: str,
    *,
    runs: int | None = None,
    methods: Sequence[str] = (),
    until_decided: bool = False,
    limit: int = 200,
    minutes: float | None = None,
    stored: bool = False,
    output: str | os.PathLike[str] | None = None,
    workers: int = 2,
    progress: Callable[[str, Progress], None] | None = None,
) -> Reproduction:
    """Repeat the comparison of a paper: our figures beside the paper's, with a verdict on each row.

    Parameters
    ----------
    paper : str
        One of `simnav.leaderboard.papers.PAPERS`, such as ``guo-2026``, or an alias.
    runs : int, optional
        Number of runs of each scenario; default: a few, so that it takes minutes.
    methods : sequence of str
        Only the rows about these methods of the paper; default: all.
    until_decided : bool
        Run the methods of undecided rows again and again, until each row is decided (see
        `simnav.leaderboard.papers.sequential`).
    limit : int
        With ``until_decided``: largest number of runs of a scenario.
    minutes : float, optional
        With ``until_decided``: time after which no further run is started.
    stored : bool
        Use the results that come with simnav, and run nothing.
    output : path, optional
        Folder; default: ``reproduced/PAPER``. Its folder ``results`` keeps the results: a later call continues there.
    workers : int
        Number of processes.
    progress : callable, optional
        Called with the name of the scenario and the campaign's progress.

    Returns
    -------
    Reproduction

    Raises
    ------
    RequestError
        If there is no such paper or method, or options contradict each other; one sentence.
    """
    from simnav.leaderboard.papers import paper as papers
    from simnav.leaderboard.papers import sequential
    from simnav.leaderboard.papers import stored as shipped
    from simnav.leaderboard.papers.reproduction import reproduce

    if stored and (until_decided or runs is not None):
        raise RequestError("stored results have a fixed number of runs: 'runs' and 'until_decided' do not go with them")
    if until_decided and runs is not None:
        raise RequestError("'until_decided' chooses the number of runs itself: give 'limit' in place of 'runs'")
    with mistakes(ValueError):
        chosen = papers.load(str(paper))
        if methods:
            chosen = chosen.only([m.strip() for m in methods.split(",")] if isinstance(methods, str) else methods)
        if stored:
            return shipped.load(chosen)
    workers, limit = whole("workers", workers, 1), whole("limit", limit, 1)
    folder = absolute(output or Path("reproduced") / chosen.key) / "results"
    with mistakes(StoreError):
        if until_decided:
            return sequential.decide(chosen, folder, limit=limit, minutes=minutes, workers=workers, progress=progress)
        count = chosen.runs if runs is None else whole("runs", runs, 1)
        return reproduce(chosen, count, folder, workers=workers, progress=progress)
