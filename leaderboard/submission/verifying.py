"""Whether a submission holds: its files, that no run is missing, a sample that is repeated, runs on sealed seeds."""

from __future__ import annotations

import itertools
import json
import math
import random
import subprocess
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.confinement.attempt import chosen_confinement
from simnav.leaderboard.campaign.own_scores import same_code, scoring_code
from simnav.leaderboard.campaign.seal import PUBLIC, Seal
from simnav.leaderboard.campaign.verification import listed
from simnav.leaderboard.profiles import load as load_profile
from simnav.leaderboard.profiles import profiles
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.leaderboard.results.provenance import BENCHMARK, Provenance, benchmark_of, distinct
from simnav.leaderboard.results.scratch import scratch
from simnav.leaderboard.submission.bundle import Bundle, open_bundle
from simnav.leaderboard.submission.environment import clean_python, install_requirements, search_variables
from simnav.leaderboard.submission.repetition import Again, Asked, Wanted
from simnav.scenario import load as load_scenario
from simnav.scoring import SCORES

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["TOLERANCE", "SealedRuns", "SubmissionReport", "runs_of", "verify_bundle"]

#: Largest relative difference of a score that counts as the same, where the bits differ.
TOLERANCE = 1e-6

_SEALED_RUNS = 8  # of each scenario
_LEVEL = 0.01  # of the test that sealed runs are no worse
_SCORE = "horizontal_rmse"
_REPEATABLE = ("ok", "error", "diverged", "invalid-output")  # a limit of time may be met on another machine


@dataclass(frozen=True)
class SealedRuns:
    """The error of an estimator on seeds that it cannot know, beside that of its results.

    Attributes
    ----------
    label, scenario : str
        Label of the estimator, versioned id of the scenario.
    public, sealed : int
        Runs of either sort.
    failed : int
        Sealed runs that failed.
    ratio : float
        Median error of the sealed runs over that of the public ones; infinite where most of them failed.
    p_value : float
        Of the rank test (Mann and Whitney) that the sealed runs are no worse, adjusted for all scenarios and estimators
        (Holm).
    """

    label: str
    scenario: str
    public: int
    sealed: int
    failed: int
    ratio: float
    p_value: float


@dataclass(frozen=True)
class SubmissionReport:
    """What came of verifying a submission.

    Attributes
    ----------
    path, digest, title : str
        The file, its SHA-256, and the name of what is submitted.
    estimators : tuple of str
        Labels.
    profile : str
        Profile that was run.
    results : int
        Number of results in the bundle.
    findings : tuple of str
        Problems of the bundle, apart from those of repeated runs.
    environment : str
        In which the runs were repeated.
    repeated, identical, close : int
        Runs that were repeated; those that gave the same bits; those that agree to the tolerance only.
    tolerance : float
        Largest relative difference of a score that counts as the same.
    different : tuple of str
        Runs that gave something else, and what.
    unknown : tuple of str
        Scores of the results that are not known where the runs were repeated, because a plug-in registers them. They
        were not looked at.
    sealed : tuple of SealedRuns
        Sealed runs by estimator and scenario; empty without a key.
    """

    path: str
    digest: str
    title: str
    estimators: tuple[str, ...]
    profile: str
    results: int
    findings: tuple[str, ...]
    environment: str
    repeated: int
    identical: int
    close: int
    tolerance: float
    different: tuple[str, ...]
    unknown: tuple[str, ...]
    sealed: tuple[SealedRuns, ...]

    @property
    def worse(self) -> tuple[SealedRuns, ...]:
        """Sealed runs that are worse than the public ones, beyond chance."""
        return tuple(s for s in self.sealed if s.p_value < _LEVEL)

    @property
    def passed(self) -> bool:
        """Whether the submission holds."""
        return bool(self.repeated) and not (self.findings or self.different or self.worse)

    def to_dict(self) -> dict[str, Any]:
        """Plain."""
        return asdict(self) | {"passed": self.passed}


def verify_bundle(
    path: Path,
    seal: Seal = PUBLIC,
    *,
    sample: int = 10,
    present: bool = False,
    tolerance: float = TOLERANCE,
    progress: Callable[..., None] | None = None,
) -> SubmissionReport:
    """Check a submission, and repeat some of its runs; see `simnav.leaderboard.publishing.verify_bundle`."""
    report = progress or (lambda *_, **__: None)
    with mistakes(ValueError):
        confinement = chosen_confinement("auto")
    if confinement == "none":
        raise RequestError("the estimator of a submission cannot be confined on this system, so it is not run")
    with scratch("verify") as home:
        bundle = open_bundle(path, home / "bundle")
        results = _results(bundle)
        findings = [*_incomplete(bundle, results), *_strange(bundle, results)]
        chosen = _sample(results, sample)
        wanted = [*_wanted(chosen), *(_sealed(bundle, results, sample) if seal.secret else ())]
        provenance = distinct(r.provenance for r in results)
        python = Path(sys.executable)
        if not present:
            report(0, None, note="making a clean environment")
            python = clean_python(home / "env", vars(provenance[0]) if provenance else {})
            install_requirements(python, bundle.contents.requires, home / "packages")
        asked = Asked(
            str(home / "runs"), bundle.requests(home / "packages"), wanted, seal.key.hex(), confinement,
        )  # fmt: skip
        again, where = repeat(python, asked, home, not present, report)
    known = {(r.scenario, r.estimator, r.seed): r for r in chosen}
    identical, close, different, unknown = 0, 0, list[str](), dict[str, None]()
    for run in (a for a in again if not a.sealed):
        before = known[run.scenario, run.label, run.seed]
        said = _difference(before, run, tolerance, where)
        if said:
            different.append(f"{run.label} on {run.scenario}, seed {run.seed}: {said}")
        elif _same_bits(before, run):
            identical += 1
        else:
            close += 1
        unknown |= dict.fromkeys(n for n in before.scores if run.scores and n not in run.scores)
    missing = len(chosen) - identical - close - len(different)
    if missing > 0:
        findings.append(f"{missing} runs of the sample gave no answer")
    contents = bundle.contents
    return SubmissionReport(
        str(path), bundle.digest, contents.title, tuple(r.label for r in contents.estimators), contents.profile,
        len(results), tuple(findings), f"{'present' if present else 'clean'} environment: {_versions(where)}",
        len(chosen), identical, close, tolerance, tuple(different), tuple(unknown),
        _compared(results, [a for a in again if a.sealed]),
    )  # fmt: skip


# --- what the bundle says ------------------------------------------------------------------------------------


def _results(bundle: Bundle) -> list[Result]:
    with warnings.catch_warnings(), mistakes(store.StoreError):
        warnings.simplefilter("ignore", store.StoreWarning)
        found = store.load(bundle.results, series=False)
    if not found:
        raise RequestError(f"{bundle.path.name} holds no results that can be read")
    version = benchmark_of(r.provenance for r in found)
    if version != BENCHMARK or bundle.contents.benchmark != BENCHMARK:
        raise RequestError(
            f"{bundle.path.name} belongs to {version or 'a benchmark without a version'}, and this version of simnav "
            f"runs {BENCHMARK}: submit it again with this version"
        )
    return found


def runs_of(profile: str) -> dict[str, int]:
    """The runs of a profile: versioned id of each scenario, and how many seeds it has."""
    found: dict[str, int] = {}
    for part in load_profile(profile).parts:
        for name in part.scenarios:
            scenario = load_scenario(name).id
            found[scenario] = max(part.runs, found.get(scenario, 0))
    return found


def _incomplete(bundle: Bundle, results: Sequence[Result]) -> list[str]:
    """Runs of the profile that are missing, so that nobody can leave out the worst."""
    contents, findings = bundle.contents, []
    if contents.profile in profiles():
        official = runs_of(contents.profile)
        for scenario in sorted({*official, *contents.runs}):
            want, said = official.get(scenario, 0), contents.runs.get(scenario, 0)
            absent = said == 0 and load_scenario(scenario).log is not None  # not everybody has the logs
            if want != said and not absent:
                findings.append(f"the profile {contents.profile} has {want} seeds of {scenario}, the bundle {said}")
    there: dict[tuple[str, str], set[int]] = {}
    for r in results:
        there.setdefault((r.scenario, r.estimator), set()).add(r.seed)
    for row in contents.estimators:
        for scenario, count in contents.runs.items():
            seeds = there.get((scenario, row.label), set())
            lacking = count - sum(0 <= k < count for k in seeds)
            if lacking:
                first = next(k for k in itertools.count() if k not in seeds)
                findings.append(f"{row.label} on {scenario}: {lacking} runs are missing, such as seed {first}")
    return findings


def _strange(bundle: Bundle, results: Sequence[Result]) -> list[str]:
    """Results that are not of the estimators that the bundle names, or were told the truth."""
    rows, findings = {r.label: r for r in bundle.contents.estimators}, []
    for label in sorted({r.estimator for r in results} - set(rows)):
        findings.append(f"there are results of {label}, which is no estimator of the bundle")
    if any(r.reference for r in results):
        findings.append("there are results of estimators that were told the truth")
    if any(r.provenance.seal for r in results):
        findings.append("there are results on sealed seeds")
    open_runs = sum(r.provenance.confinement in ("", "none") for r in results if r.tried)
    if open_runs:
        findings.append(f"{open_runs} results were computed without confinement")
    return findings


def _sample(results: Sequence[Result], most: int) -> list[Result]:
    """Runs at random, taken from all scenarios and estimators in turn."""
    draw = random.SystemRandom()
    groups: dict[tuple[str, str], list[Result]] = {}
    for result in results:
        if result.status in _REPEATABLE and not result.reference:
            groups.setdefault((result.scenario, result.estimator), []).append(result)
    for group in groups.values():
        draw.shuffle(group)
    order = list(groups)
    draw.shuffle(order)
    chosen: list[Result] = []
    while len(chosen) < most and any(groups.values()):
        chosen += [groups[key].pop() for key in order if groups[key]][: most - len(chosen)]
    return chosen


def _wanted(results: Sequence[Result]) -> list[Wanted]:
    groups: dict[tuple[str, str, float, int], list[int]] = {}
    for r in results:
        groups.setdefault((r.scenario, r.estimator, r.time_limit, r.memory_limit), []).append(r.seed)
    return [Wanted(scenario, label, seeds, time, memory) for (scenario, label, time, memory), seeds in groups.items()]


def _sealed(bundle: Bundle, results: Sequence[Result], sample: int) -> list[Wanted]:
    """Some runs on sealed seeds, about as many as are repeated, but never few of a scenario."""
    pairs = sorted({(r.scenario, r.estimator) for r in results if r.status == "ok"})
    chosen = random.SystemRandom().sample(pairs, min(len(pairs), max(1, -(-sample // _SEALED_RUNS))))
    return [Wanted(scenario, label, list(range(_SEALED_RUNS)), sealed=True) for scenario, label in chosen]


# --- running ---------------------------------------------------------------------------------------------------


def repeat(
    python: Path, asked: Asked, home: Path, clean: bool, report: Callable[..., None]
) -> tuple[list[Again], Provenance]:
    """Run the repetition in another process; returns the runs, and the provenance there."""
    command = [str(python), "-m", "simnav.leaderboard.submission.repetition"]
    facts: dict[str, Any] = {}
    variables = search_variables(clean)
    if clean:  # kernels are kept by the path of their file, and this one will not be there again
        variables["SIMNAV_CACHE_DIR"] = str(home / "kernels")
    with (
        open(home / "errors", "w+b") as errors,
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, cwd=home, env=variables, text=True,
        ) as process,
    ):  # fmt: skip
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(asked.text() + "\n")
            process.stdin.close()
            for line in process.stdout:
                if line.startswith("P "):
                    done, total, note = json.loads(line[2:])
                    report(done, total, note=note)
                elif line.startswith("R "):
                    facts = json.loads(line[2:])
            process.wait()
        except BaseException:
            process.kill()
            raise
        errors.seek(0)
        said = errors.read()[-2000:].decode(errors="replace").strip().splitlines()
    if not facts:
        raise RequestError(f"the runs could not be repeated: {(said or ['the process ended'])[-1]}")
    return [Again(**run) for run in facts["runs"]], Provenance.from_dict(facts["provenance"])


def _versions(where: Provenance) -> str:
    return (
        f"simnav {where.simnav}, Python {where.python}, numpy {where.numpy}, numba {where.numba}, gtsam {where.gtsam}, "
        f"{where.cpu or where.system}"
    )


# --- comparing -------------------------------------------------------------------------------------------------


def _compared_scores(before: Result, again: Again) -> dict[str, tuple[float, float]]:
    """The scores that both have, wall times aside; a score of a plug-in may be known in one place only."""
    return {
        name: (value, again.scores[name])
        for name, value in before.scores.items()
        if name in again.scores and not name.startswith("update_")
    }


def _removed(before: Result, again: Again) -> list[str]:
    """Scores that the results lack, though simnav computed them then: the main one, and all of unchanged code."""
    homes = same_code(before.scoring, scoring_code())
    absent = (name for name in again.scores if name not in before.scores and not name.startswith("update_"))
    return [name for name in absent if name == _SCORE or (name in SCORES and SCORES[name].__module__ in homes)]


def _same_bits(before: Result, again: Again) -> bool:
    pairs = _compared_scores(before, again).values()
    return all(float(a).hex() == float(b).hex() for a, b in pairs)


def _difference(before: Result, again: Again, tolerance: float, where: Provenance) -> str:
    """What differs, in words; empty where the run is the same to the tolerance."""
    if again.status == "not-run":
        return f"it could not be run: {again.reason}"
    if again.recording != before.recording:
        made = before.provenance
        return (
            "the scenario or the simulator is not that of the results, which were made with simnav "
            f"{made.simnav} at commit {made.commit[:12] or 'unknown'}{' with changes' if made.dirty else ''}; here is "
            f"{where.simnav} at commit {where.commit[:12] or 'unknown'}"
        )
    if again.key != before.key:
        return "the results were not made with this source, this name and these parameters"
    if again.status != before.status:
        return f"it ended with {again.status} ({again.reason or 'no reason'}), and in the results with {before.status}"
    if removed := _removed(before, again):
        return f"the results lack {listed(removed)}"
    worst, text = tolerance, ""
    for name, (a, b) in _compared_scores(before, again).items():
        if a == b or (math.isnan(a) and math.isnan(b)):
            continue
        apart = abs(a - b) / max(abs(a), abs(b)) if math.isfinite(a) and math.isfinite(b) else math.inf
        if apart > worst:
            worst, text = apart, f"{name} is {b:.9g}, and in the results {a:.9g} (relative difference {apart:.2g})"
    return text


def _compared(results: Sequence[Result], again: Sequence[Again]) -> tuple[SealedRuns, ...]:
    """Sealed runs beside public ones, by estimator and scenario."""
    found = []
    for scenario, label in sorted({(a.scenario, a.label) for a in again}):
        public = [_error(r.status, r.scores) for r in results if (r.scenario, r.estimator) == (scenario, label)]
        mine = [a for a in again if (a.scenario, a.label) == (scenario, label)]
        sealed = [_error(a.status, a.scores) for a in mine]
        failed = sum(a.status != "ok" for a in mine)
        ratio, p_value = _ratio(public, sealed), _rank_test(public, sealed)
        found.append(SealedRuns(label, scenario, len(public), len(sealed), failed, ratio, p_value))
    largest, adjusted = 0.0, dict[SealedRuns, float]()
    for place, one in enumerate(sorted(found, key=lambda s: s.p_value)):  # Holm (1979)
        largest = max(largest, min(1.0, (len(found) - place) * one.p_value))
        adjusted[one] = largest
    return tuple(replace(s, p_value=adjusted[s]) for s in found)


def _error(status: str, scores: Mapping[str, float]) -> float:
    """The error of a run; infinite for one that failed."""
    value = scores.get(_SCORE, math.nan)
    return value if status == "ok" and math.isfinite(value) else math.inf


def _rank_test(public: Sequence[float], sealed: Sequence[float]) -> float:
    from scipy.stats import mannwhitneyu

    if not public or not sealed:
        return 1.0
    largest = max((e for e in (*public, *sealed) if math.isfinite(e)), default=1.0)
    finite = [[min(e, 2.0 * largest) for e in side] for side in (sealed, public)]  # its order is all that counts
    return float(mannwhitneyu(*finite, alternative="greater").pvalue)


def _ratio(public: Sequence[float], sealed: Sequence[float]) -> float:
    import statistics

    if not public or not sealed:
        return math.nan
    below, above = statistics.median(public), statistics.median(sealed)
    return above / below if math.isfinite(below) and below > 0.0 else math.nan
