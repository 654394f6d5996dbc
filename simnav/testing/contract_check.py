"""The contract test for estimators: the checks that `simnav check` and `simnav.testing` run.

The estimator runs on 40 seconds of a simulated voyage with every kind of instrument, in several forms. Each requirement
of the contract is one `Check`, a function whose first sentence states the requirement; `CHECKS` has all of them in the
order of the report. The checks do not test accuracy.
"""

from __future__ import annotations

import contextlib
import copy
import tomllib
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.estimator import Estimator, make
from simnav.recording import Recording
from simnav.testing.altered_recordings import altered, silenced, until, without
from simnav.testing.contract_runs import Output, Watched, difference, parting, run, steps, watch
from simnav.trial import Trial, run_trial

if TYPE_CHECKING:
    from simnav.scenario import Scenario
    from simnav.sensors import AidSpec

__all__ = ["CHECKS", "Candidate", "Check", "Finding", "Report", "check", "contract_recording"]

#: The scenario of the contract test, but for the aiding instruments: one of every kind (`_contract_scenario`).
SCENARIO = """
name = "contract"
version = 1
title = "40 seconds with every instrument"
duration_s = 40.0
water_depth_m = 60.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
heading_deg = 40.0
speed_m_s = 5.0
[[manoeuvre]]
kind = "hold"
duration_s = 10.0
[[manoeuvre]]
kind = "turn"
angle_deg = 40.0
rate_deg_s = 2.0
[sea]
significant_height_m = 1.0
peak_period_s = 6.0
[instruments.imu]
rate_hz = 20.0
gyroscope = { bias_deg_h = 1.0, random_walk_deg_sqrt_h = 0.05 }
accelerometer = { bias_ug = 200.0, random_walk_ug_sqrt_hz = 50.0 }
"""

_HALF = 20.0  # s
#: How much of the recording an estimator without one of its instruments runs over [s].
_BEGINNING = 12.0
#: Interval of the readings of an instrument with channels or with states of its own: a reading of n channels costs as
#: much as n others, and states make each epoch dear [s].
_DEAR_EVERY = 10.0

#: How far the first estimate may be from the initial state: multiples of its sigma, and the motion of one second.
_SIGMAS, _CHANGE = 6.0, {"velocity": 1.0, "attitude": 0.1}
_VELOCITY, _ANGLES = ("velocity north", "velocity east", "velocity down"), ("roll", "pitch", "yaw")

Factory = Callable[[], Estimator]
_Function = Callable[["Candidate", Recording], tuple[bool, str]]
_checks: list[Check] = []


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Attributes
    ----------
    name : str
        Name of the check.
    ok : bool
        Whether the estimator keeps this part of the contract.
    sentence : str
        One sentence: how the estimator meets the requirement, or where it does not.
    """

    name: str
    ok: bool
    sentence: str


@dataclass(frozen=True, repr=False)
class Report:
    """All findings about one estimator.

    Attributes
    ----------
    estimator : str
        Registered name, or the name of the class.
    findings : tuple of Finding
        One for each check that was run, in the order of `CHECKS`.
    passed : bool
        Whether all findings are ok.
    """

    estimator: str
    findings: tuple[Finding, ...]
    passed: bool

    def to_dict(self) -> dict[str, Any]:
        """Plain: what ``simnav check --json`` prints."""
        return {
            "estimator": self.estimator,
            "passed": self.passed,
            "findings": [{"name": f.name, "ok": f.ok, "sentence": f.sentence} for f in self.findings],
        }

    def __repr__(self) -> str:
        bad = ", ".join(f.name for f in self.findings if not f.ok)
        return f"<Report: {self.estimator} {'passes' if self.passed else f'fails: {bad}'}>"

    def __str__(self) -> str:
        lines = [f"{'ok  ' if f.ok else 'FAIL'}  {f.name}: {f.sentence}" for f in self.findings]
        bad = sum(not f.ok for f in self.findings)
        verdict = "passes the contract test" if self.passed else f"fails the contract test ({bad} findings)"
        return "\n".join([*lines, f"{self.estimator} {verdict}"])


class Candidate:
    """An estimator under test, with the recording and the first run that its checks share.

    Parameters
    ----------
    factory : callable
        Makes a new instance when called. It is called once here.

    Attributes
    ----------
    factory : callable
        The argument of the same name.
    name : str
        Registered name, or the name of the class.
    """

    def __init__(self, factory: Factory):
        self.factory = factory
        self._first = factory()
        self.name = self._first.name or type(self._first).__name__

    @cached_property
    def recording(self) -> Recording:
        """The recording of the contract test; each check gets a copy."""
        return contract_recording(0)

    @cached_property
    def trial(self) -> Trial:
        """The first run over the recording."""
        return run_trial(self._first, self.recording)

    @cached_property
    def fresh(self) -> Output:
        """What a new instance gives on the recording."""
        return run(self.factory(), self.recording)

    @cached_property
    def watched(self) -> Watched:
        """A run in which the input and all estimates are compared with what they were."""
        return watch(self.factory(), copy.deepcopy(self.recording))

    @cached_property
    def unsteady(self) -> str | None:
        """Where two instances differ on the same recording, or None."""
        return difference(self.fresh, run(self.factory(), self.recording))


@dataclass(frozen=True)
class Check:
    """One requirement of the contract.

    Attributes
    ----------
    name : str
        Name in reports and in the ids of tests.
    sentence : str
        The requirement, as a sentence.
    function : callable
        ``function(candidate, recording)`` returns whether the requirement is met, and a sentence about it.
    """

    name: str
    sentence: str
    function: Callable[[Candidate, Recording], tuple[bool, str]]

    def __call__(self, candidate: Candidate) -> Finding:
        """Run the check; an exception of the estimator is a finding, too.

        Parameters
        ----------
        candidate : Candidate
            The estimator under test. It gets a copy of the recording, so that changes of its input do not affect other
            checks.
        """
        try:
            return Finding(self.name, *self.function(candidate, copy.deepcopy(candidate.recording)))
        except Exception as error:
            return Finding(self.name, False, f"it raised {type(error).__name__}: {error}")

    def left_out(self, candidate: Candidate) -> str:
        """The reason to skip the check for an estimator; empty if the check is useful.

        If the output is not valid, the other checks would only repeat this. The exception is ``units`` of an
        estimator that diverges, because wrong units may be the reason. If two instances differ, ``reset`` and
        ``causality`` say nothing.
        """
        if self.name == "output":
            return ""
        if not _output(candidate, candidate.recording)[0]:
            if self.name == "units" and candidate.trial.status == "diverged":
                return ""
            return "the check 'output' fails, and this check would only repeat it"
        if self.name in ("reset", "causality"):
            with contextlib.suppress(Exception):  # the check itself says what was raised
                if candidate.unsteady is not None:
                    return "the check 'determinism' fails, and this check would only repeat it"
        return ""


def _demand(name: str) -> Callable[[_Function], _Function]:
    """Add a function to `CHECKS`; the first paragraph of its docstring is the requirement."""

    def add(function: _Function) -> _Function:
        sentence = " ".join((function.__doc__ or "").partition("\n\n")[0].split())
        _checks.append(Check(name, sentence, function))
        return function

    return add


def check(estimator: str | Callable[[], Estimator], **parameters: Any) -> Report:
    """Test an estimator against the contract.

    The checks are: valid output (time, shapes, finite values, a symmetric positive semi-definite covariance), units,
    determinism, the same behaviour after a reset, causality, unmodified input, estimates that later steps do not
    modify, instruments that stop delivering measurements, and missing instruments (each alone, and all).

    Parameters
    ----------
    estimator : str or callable
        Name or path, as for `simnav.estimator.make`; or a function that returns a new instance.
    **parameters
        Parameters of the estimator, if it is given by name or path.

    Returns
    -------
    Report
        The results of all checks.

    Raises
    ------
    EstimatorError
        If there is no such estimator, or it cannot be constructed.
    """
    if isinstance(estimator, str):
        name_or_path = estimator

        def factory() -> Estimator:
            return make(name_or_path, **parameters)
    else:
        factory = estimator
    candidate = Candidate(factory)
    findings = tuple(c(candidate) for c in CHECKS if not c.left_out(candidate))
    return Report(candidate.name, findings, all(f.ok for f in findings))


def contract_recording(seed: int) -> Recording:
    """The recording of the contract test, with one instrument of every registered kind.

    A kind of a third party whose instrument fails is named in a warning and left out.
    """
    from simnav.sensors import instrument_specs
    from simnav.source import record

    specs = instrument_specs()
    try:
        return record(_contract_scenario(specs), seed)
    except Exception:
        own = [cls for cls in specs if cls.__module__.startswith("simnav.")]
        sound = list(own)
        for cls in specs:
            if cls in own:
                continue
            try:
                record(_contract_scenario([cls]), seed)
                sound.append(cls)
            except Exception as error:
                warnings.warn(
                    f"instruments of kind {cls.model_fields['kind'].default!r} are left out of the contract test: "
                    f"{type(error).__name__}: {error}",
                    stacklevel=2,
                )
        if len(sound) == len(specs):
            raise
        return record(_contract_scenario(sound), seed)


def _contract_scenario(specs: Sequence[type[AidSpec]]) -> Scenario:
    from simnav.scenario import Scenario

    table = tomllib.loads(SCENARIO)
    for cls in specs:
        kind = cls.model_fields["kind"].default
        spec = cls.from_toml({**cls.example, "kind": kind})
        dear = spec.channels() or len(spec.blocks()) > 1
        seldom = {"rate_hz": 1.0 / _DEAR_EVERY} if dear else {}
        table["instruments"][kind] = {**cls.example, **seldom}
        table["instruments"] |= {name: {**other, **seldom} for name, other in cls.beside.items()}
    return Scenario.from_toml(table, source="the contract test")


@_demand("output")
def _output(candidate: Candidate, recording: Recording) -> tuple[bool, str]:
    """Every step returns a valid `Estimate`: right time and shapes, finite values, a valid covariance."""
    trial = candidate.trial
    if trial.status == "unsuitable":
        return False, f"its needs are not met even where every kind of instrument is there: {trial.reason}"
    if trial.status != "ok":
        return False, f"{trial.status}: {trial.reason}"
    vectors = [v for v in ("position", "velocity", "attitude") if np.isfinite(getattr(trial, v)).any()]
    if not vectors:
        return False, "it estimates nothing: position, velocity and attitude are all None"
    covariance = "with" if trial.covariance is not None else "without"
    return True, f"{len(trial)} valid estimates of {', '.join(vectors)}, {covariance} covariance"


@_demand("units")
def _units(candidate: Candidate, recording: Recording) -> tuple[bool, str]:
    """Estimates are in SI units and radians, and begin at the initial state; positions are latitude, longitude, height.

    After one step a position in other units is thousands of kilometres off, for which coarse limits are enough.
    Velocity and attitude may differ from the initial state by `_SIGMAS` times its sigma, and by what the vessel can do
    in a second (`_CHANGE`).
    """
    first = next(iter(steps(candidate.factory(), recording)))
    start = recording.start
    wrong: list[str] = []
    mask = first.mask()
    if first.position is not None and mask[:2].all():
        p = first.position
        if np.any(np.abs(p[:2] - start.position[:2]) > 1e-3):
            wrong.append(
                f"position {np.round(p, 6).tolist()} is over 6 km from the start; it is latitude, longitude [rad]"
            )
        if mask[2] and abs(p[2] - start.position[2]) > 1e3:
            wrong.append(f"height {p[2]:g} m is over 1 km from the start")
    sigma = np.sqrt(start.covariance.diagonal())
    for name, unit, at, about in (
        ("velocity", "m/s", slice(3, 6), _VELOCITY),
        ("attitude", "rad", slice(6, 9), _ANGLES),
    ):
        value, initial = getattr(first, name), getattr(start, name)
        if value is None:
            continue
        off = np.abs(value - initial)
        if name == "attitude":
            off = np.where(np.abs(value) <= 2.0 * np.pi, np.minimum(off, np.abs(off - 2.0 * np.pi)), off)
        for k, part in enumerate(about):
            limit = _SIGMAS * sigma[at][k] + _CHANGE[name]
            if mask[at][k] and off[k] > limit:
                wrong.append(
                    f"{part} is {value[k]:.3g} {unit} after a second; the initial state has {initial[k]:.3g} {unit}, "
                    f"and the estimate is to be within {limit:.2g} {unit} of that"
                )
    return not wrong, "; ".join(wrong) or "the first estimate is near the initial state"


@_demand("determinism")
def _determinism(candidate: Candidate, recording: Recording) -> tuple[bool, str]:
    """Two instances give the same estimates, diagnostics, flags and smoothed trajectory, bit for bit."""
    where = candidate.unsteady
    return where is None, where or "two instances agree bit for bit on the same recording"


@_demand("reset")
def _reset(candidate: Candidate, recording: Recording) -> tuple[bool, str]:
    """After a run, `reset` restores the initial behaviour: the next run gives the estimates of a new instance."""
    used = candidate.factory()
    run(used, until(contract_recording(1), _HALF))
    where = difference(candidate.fresh, run(used, recording))
    sentence = (
        "after a run and a reset it is as good as new" if where is None else f"a run before reset() shows: {where}"
    )
    return where is None, sentence


@_demand("causality")
def _causality(candidate: Candidate, recording: Recording) -> tuple[bool, str]:
    """An estimate does not depend on later measurements.

    All measurements of the second half of the run are changed; the estimates of the first half must stay the same. The
    runs end there: who looks ahead, in the arrays behind a packet or as a reference, has the later data in memory.
    """
    n = int(np.searchsorted(recording.data.truth.time, _HALF + 1e-6))
    changed = [copy.deepcopy(e) for e in islice(steps(candidate.factory(), altered(recording, _HALF)), n)]
    where = parting(candidate.fresh.estimates[:n], changed)
    ok = where is None
    return ok, "estimates do not know later data" if ok else f"later data change it: {where}"


@_demand("input")
def _input(candidate: Candidate, recording: Recording) -> tuple[bool, str]:
    """The estimator does not write into its input."""
    spoilt = candidate.watched.spoilt
    ok = not spoilt
    return ok, "it leaves its input alone" if ok else f"it writes into: {', '.join(spoilt)}"


@_demand("estimates")
def _aliasing(candidate: Candidate, recording: Recording) -> tuple[bool, str]:
    """An estimate that was returned is not changed by later steps."""
    where = candidate.watched.rewritten
    ok = where is None
    return ok, "later steps leave them alone" if ok else f"a later step writes into one (copy it): {where}"


@_demand("silence")
def _silence(candidate: Candidate, recording: Recording) -> tuple[bool, str]:
    """The estimator continues when instruments stop delivering measurements.

    Every aiding instrument stops in the middle of the run, and later also the IMU.
    """
    for what, imu in (("every aiding instrument", True), ("every instrument", False)):
        trial = run_trial(candidate.factory(), silenced(recording, _HALF, imu))
        if trial.status != "ok":
            return False, f"after {what} stopped: {trial.status}: {trial.reason}"
    return True, "it continues when the instruments deliver no more measurements"


@_demand("missing instruments")
def _missing(candidate: Candidate, recording: Recording) -> tuple[bool, str]:
    """Without an instrument the estimator works, or its `needs` name the instrument; it refuses no other scenario."""
    names, beginning = list(recording.instruments), until(recording, _BEGINNING)
    few = without(beginning, [n for n, sheet in recording.instruments.items() if sheet.channels or sheet.blocks])
    if run_trial(candidate.factory(), few).status != "ok":
        few = beginning
    needed: list[str] = []
    for absent in (["imu"], *([n] for n in names), names, [*names, "imu"]):
        # States that an instrument brings along make every epoch dear. They stay where such an instrument is absent.
        one_of_few = len(absent) == 1 and absent[0] in few.instruments
        trial = run_trial(candidate.factory(), without(few if one_of_few else beginning, absent))
        label = absent[0] if len(absent) == 1 else "instruments" if "imu" in absent else "aiding instruments"
        if trial.status not in ("ok", "unsuitable"):
            return False, f"without {label}: {trial.status}: {trial.reason}"
        if trial.status == "unsuitable":
            needed.append(label)
    if not needed:
        return True, "it works without any of them"
    return True, f"it declares that it cannot run without {', or without '.join(needed)}"


#: All checks, in the order of the report.
CHECKS = tuple(_checks)
