"""Whether a submission holds: its files, that no run is missing, a sample that is repeated, runs on sealed seeds."""

from __future__ import annotations

import itertools
import json
import math
import random
import statistics
import subprocess
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.campaign import MEMORY
from simnav.leaderboard.campaign.comparison import CLAIMED, claims, differing, listed, proven, too_quick
from simnav.leaderboard.campaign.confinement.attempt import chosen_confinement
from simnav.leaderboard.campaign.recorder import time_limit
from simnav.leaderboard.campaign.sampling import findable, sample_size
from simnav.leaderboard.campaign.seal import PUBLIC, Seal
from simnav.leaderboard.profiles import profiles
from simnav.leaderboard.profiles import read_profile as load_profile
from simnav.leaderboard.results import store
from simnav.leaderboard.results.catalogued import catalogued_scenario
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.leaderboard.results.provenance import BENCHMARK, Provenance, benchmark_of, distinct
from simnav.leaderboard.results.scratch import scratch
from simnav.leaderboard.results.versions import is_declared
from simnav.scenario import load as load_scenario
from simnav.scoring import SCORES

from .bundle import Bundle, open_bundle
from .environment import clean_python, install_requirements, search_variables
from .repetition import Again, Asked, Wanted

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["TOLERANCE", "SealedRuns", "SubmissionReport", "runs_of", "verify_bundle"]

#: Largest relative difference of a score that counts as the same, where the bits differ.
TOLERANCE = 1e-6

_SEALED_RUNS = 8  # of each scenario
_LEVEL = 0.01  # of the test that sealed runs are no worse
_SCORE = "horizontal_rmse"


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
    undecided : tuple of str
        Runs that the repetition does not confirm, such as one that meets a limit of time on one machine only.
    unconfirmed : tuple of str
        What the results say of commit, processor, system and confinement, and cannot be confirmed here.
    unconfirmed_fields, claimed : tuple of str
        Names of the fields in ``unconfirmed``, and of all that no repetition proves.
    summary : str
        What is proven and what is only claimed, in one sentence.
    finds : str
        What the sample can find.
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
    undecided: tuple[str, ...]
    unconfirmed: tuple[str, ...]
    finds: str
    unknown: tuple[str, ...]
    sealed: tuple[SealedRuns, ...]
    unconfirmed_fields: tuple[str, ...] = ()
    claimed: tuple[str, ...] = CLAIMED
    summary: str = ""

    @property
    def worse(self) -> tuple[SealedRuns, ...]:
        """Sealed runs that are worse than the public ones, beyond chance."""
        return tuple(s for s in self.sealed if s.p_value < _LEVEL)

    @property
    def passed(self) -> bool:
        """Whether the submission holds."""
        return bool(self.repeated) and not (self.findings or self.different or self.undecided or self.worse)

    def to_dict(self) -> dict[str, Any]:
        """The fields as values that JSON can hold."""
        return asdict(self) | {"passed": self.passed}


def verify_bundle(
    path: Path,
    seal: Seal = PUBLIC,
    *,
    sample: int | None = None,
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
        results, set_aside = _results(bundle)
        findings = [*set_aside, *_incomplete(bundle, results), *_strange(bundle, results)]
        count = sample_size(len(results)) if sample is None else min(sample, len(results))
        chosen = random.SystemRandom().sample(results, count)
        wanted = [*_wanted(chosen), *(_sealed(bundle, results, count) if seal.secret else ())]
        provenance = distinct(r.provenance for r in results)
        python = Path(sys.executable)
        if not present:
            report(0, None, note="making a clean environment")
            python = clean_python(home / "env", vars(provenance[0]) if provenance else {})
            install_requirements(python, bundle.contents.requires, home / "packages")
        asked = Asked(
            str(home / "runs"), bundle.requests(home / "packages"), wanted, seal.key.hex(), confinement,
            all(is_declared(r.recording) for r in results),
        )  # fmt: skip
        again, where = repeat(python, asked, home, not present, report)
    known = {(r.scenario, r.estimator, r.seed): r for r in chosen}
    identical, close, different, undecided, unknown = 0, 0, list[str](), list[str](), dict[str, None]()
    pairs = []
    for run in (a for a in again if not a.sealed and (a.scenario, a.label, a.seed) in known):
        before, what = known[run.scenario, run.label, run.seed], f"{run.label} on {run.scenario}, seed {run.seed}"
        said, open_questions = _difference(before, run, tolerance, where)
        if run.status != "not-run":
            pairs.append((before, run.result))
        if said:
            different.append(f"{what}: {said}")
        elif open_questions:
            undecided.append(f"{what}: {open_questions}")
        elif _same_bits(before, run):
            identical += 1
        else:
            close += 1
        unknown |= dict.fromkeys(n for n in before.scores if run.scores and n not in run.scores)
    missing = len(chosen) - identical - close - len(different) - len(undecided)
    if missing > 0:
        findings.append(f"{missing} runs of the sample gave no answer")
    different += too_quick(pairs)
    used = next((a.confinement for a in again if a.confinement), "")
    contents = bundle.contents
    said_of = claims(results, replace(where, confinement=used), contents.requires)
    findings += said_of.different
    return SubmissionReport(
        str(path), bundle.digest, contents.title, tuple(r.label for r in contents.estimators), contents.profile,
        len(results), tuple(findings), f"{'present' if present else 'clean'} environment: {_versions(where)}",
        len(chosen), identical, close, tolerance, tuple(different), tuple(undecided),
        tuple(said_of.unconfirmed), findable(len(results), len(chosen)), tuple(unknown),
        _compared(results, [a for a in again if a.sealed]), tuple(said_of.fields),
        summary=proven(identical + close, said_of.fields),
    )  # fmt: skip


# --- what the bundle says ------------------------------------------------------------------------------------


def _results(bundle: Bundle) -> tuple[list[Result], list[str]]:
    """The results, and why others in the bundle were not taken."""
    with warnings.catch_warnings(record=True) as said, mistakes(store.StoreError):
        warnings.simplefilter("always", store.StoreWarning)
        found = store.load(bundle.results, series=False)
    lost = [str(w.message) for w in said if isinstance(w.message, store.StoreWarning)]
    set_aside = [text.replace(f"{bundle.results}", "results") for text in lost]
    if not found:
        raise RequestError(f"{bundle.path.name} holds no results that can be read")
    version = benchmark_of(r.provenance for r in found)
    if version != BENCHMARK or bundle.contents.benchmark != BENCHMARK:
        raise RequestError(
            f"{bundle.path.name} belongs to {version or 'a benchmark without a version'}, and this version of simnav "
            f"runs {BENCHMARK}: submit it again with this version"
        )
    return found, set_aside


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
            if want == said:
                continue
            try:
                absent = said == 0 and catalogued_scenario(scenario).log is not None  # not everybody has the logs
            except RequestError as error:
                findings.append(str(error))
                continue
            if not absent:
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
    findings += _limits(results)
    made = distinct(r.provenance for r in results)
    for name in ("simnav", "commit", "numpy", "numba", "gtsam"):
        if len(several := sorted({str(getattr(p, name)) for p in made})) > 1:
            findings.append(f"its results were made with several versions of {name}: {', '.join(several):.200}")
    open_runs = sum(r.provenance.confinement in ("", "none") for r in results if r.tried)
    if open_runs:
        findings.append(f"{open_runs} results were computed without confinement")
    return findings


def _limits(results: Sequence[Result]) -> list[str]:
    """Limits that are not those of `simnav submit`, under which a run could be said to have failed or to have held."""
    findings = []
    for scenario in sorted({r.scenario for r in results}):
        try:
            usual = time_limit(catalogued_scenario(scenario)), int(MEMORY * 2**20)
        except RequestError as error:
            findings.append(str(error))
            continue
        other = [r for r in results if r.scenario == scenario and (r.time_limit, r.memory_limit) != usual]
        if other:
            findings.append(
                f"{len(other)} results on {scenario} have other limits than {usual[0]:g} s and {usual[1] >> 20} MiB, "
                f"such as {other[0].time_limit:g} s and {other[0].memory_limit >> 20} MiB"
            )
    return findings


def _wanted(results: Sequence[Result]) -> list[Wanted]:
    groups: dict[tuple[str, str], list[int]] = {}
    for r in results:
        groups.setdefault((r.scenario, r.estimator), []).append(r.seed)
    return [Wanted(scenario, label, seeds) for (scenario, label), seeds in groups.items()]


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
    """Scores of simnav that the results lack: `simnav submit` computes all."""
    absent = (name for name in again.scores if name not in before.scores)
    return [name for name in absent if name in SCORES and SCORES[name].__module__.startswith("simnav.")]


def _same_bits(before: Result, again: Again) -> bool:
    pairs = _compared_scores(before, again).values()
    return all(float(a).hex() == float(b).hex() for a, b in pairs)


def _difference(before: Result, again: Again, tolerance: float, where: Provenance) -> tuple[str, str]:
    """What differs, and what is not confirmed, in words; both empty where the run is the same to the tolerance."""
    if again.status == "not-run":
        return f"it could not be run: {again.reason}", ""
    if code := _other_code(before, again.result, where):
        return code, ""
    different, undecided = differing(before, again.result)
    if before.status == again.status:
        if removed := _removed(before, again):
            different.append(f"the results lack {listed(removed)}")
        different += filter(None, [_worst_score(before, again, tolerance)])
    return listed(different), listed(undecided)


def _other_code(before: Result, again: Result, where: Provenance) -> str:
    """Why a run is not the same: another simulator or scenario, other files of the submitter; empty where it is."""
    if again.recording != before.recording:
        made = before.provenance
        return (
            f"the scenario or the simulator is not that of the results, which were made with simnav {made.simnav}"
            f"{_at(made)} ({before.recording:.40}); here is {where.simnav}{_at(where)} ({again.recording:.40})"
        )
    if again.estimator_version != before.estimator_version:
        return f"the estimator declares version {again.estimator_version}, the results {before.estimator_version}"
    if again.key != before.key or (is_declared(before.recording) and again.estimator_digest != before.estimator_digest):
        return "the results were not made with this source, this name and these parameters"
    return ""


def _at(made: Provenance) -> str:
    return f" at commit {made.commit[:12] or 'unknown'}{' with changes' if made.dirty else ''}"


def _worst_score(before: Result, again: Again, tolerance: float) -> str:
    """The score that differs most, in words; empty where all agree to the tolerance."""
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
    if not public or not sealed:
        return math.nan
    below, above = statistics.median(public), statistics.median(sealed)
    return above / below if math.isfinite(below) and below > 0.0 else math.nan
