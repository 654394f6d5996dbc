"""The contract test for estimators: what `simnav check` runs.

A minute of a simulated voyage with every kind of instrument is given to the estimator in several forms; see `check` for
what is looked at. It says nothing of accuracy.
"""

from __future__ import annotations

import copy
import hashlib
import pickle
import tomllib
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.estimator import Estimator, make
from simnav.recording import AidStream, Block, Recording
from simnav.trial import Trial, run_trial
from simnav.types import KINDS, Estimate, ImuSamples, Instruments

if TYPE_CHECKING:
    from simnav.scenario import Scenario
    from simnav.sensors import AidSpec

__all__ = ["Finding", "Report", "check"]

#: The scenario of the contract test, but for the aiding instruments: one of every kind (`_contract_scenario`).
SCENARIO = """
name = "contract"
version = 1
title = "a minute with every instrument"
duration_s = 60.0
water_depth_m = 60.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
heading_deg = 40.0
speed_m_s = 5.0
[[manoeuvre]]
kind = "hold"
duration_s = 15.0
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

_HALF = 30.0  # s

Factory = Callable[[], Estimator]


@dataclass(frozen=True)
class Finding:
    """What one part of the test found.

    Attributes
    ----------
    name : str
    ok : bool
    sentence : str
    """

    name: str
    ok: bool
    sentence: str


@dataclass(frozen=True)
class Report:
    """All findings about one estimator.

    Attributes
    ----------
    estimator : str
    findings : tuple of Finding
    passed : bool
        Whether all are ok.
    """

    estimator: str
    findings: tuple[Finding, ...]
    passed: bool

    def __str__(self) -> str:
        lines = [f"{'ok  ' if f.ok else 'FAIL'}  {f.name}: {f.sentence}" for f in self.findings]
        bad = sum(not f.ok for f in self.findings)
        verdict = "passes the contract test" if self.passed else f"fails the contract test ({bad} findings)"
        return "\n".join([*lines, f"{self.estimator} {verdict}"])


def check(estimator: str | Callable[[], Estimator], **parameters: Any) -> Report:
    """Test an estimator against the contract.

    Looked at: valid output (time, shapes, finite values, a covariance that is symmetric and positive semi-definite),
    units, determinism, recovery after reset, causality, input left alone, estimates that later steps leave alone,
    instruments that fall silent, and instruments that are absent, each in turn and all.

    Parameters
    ----------
    estimator : str or callable
        Name or path, as for `simnav.estimator.make`; or what makes a new instance when called.
    **parameters
        Of the estimator, if it is a name or path.

    Returns
    -------
    Report

    Raises
    ------
    EstimatorError
        If there is no such estimator, or it cannot be made.
    """
    if isinstance(estimator, str):
        name_or_path = estimator

        def factory() -> Estimator:
            return make(name_or_path, **parameters)
    else:
        factory = estimator
    first = factory()
    name = first.name or type(first).__name__
    recording = contract_recording(0)
    trial = run_trial(first, recording)
    findings = [_output(trial)]
    if trial.status == "diverged":
        findings.append(_guarded(_units, factory, recording))  # they may be why
    if findings[0].ok:  # otherwise the other tests would only repeat what was said
        tests = (_units, _determinism, _reset, _causality, _input, _aliasing, _silence, _missing)
        findings += [_guarded(test, factory, recording) for test in tests]
    return Report(name, tuple(findings), all(f.ok for f in findings))


def contract_recording(seed: int) -> Recording:
    """The recording of the contract test, with one instrument of every kind that is known.

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
    table["instruments"] |= {cls.model_fields["kind"].default: cls.example for cls in specs}
    return Scenario.from_toml(table, source="the contract test")


def _guarded(test: Callable[[Factory, Recording], Finding], factory: Factory, recording: Recording) -> Finding:
    try:
        return test(factory, recording)
    except Exception as error:
        name = test.__name__.removeprefix("_").replace("_", " ")
        return Finding(name, False, f"it raised {type(error).__name__}: {error}")


def _output(trial: Trial) -> Finding:
    if trial.status == "unsuitable":
        said = f"it said: {trial.reason}" if trial.reason else "it did not say why"
        return Finding("output", False, f"it is not suited even where every kind of instrument is there; {said}")
    if trial.status != "ok":
        return Finding("output", False, f"{trial.status}: {trial.reason}")
    vectors = [v for v in ("position", "velocity", "attitude") if np.isfinite(getattr(trial, v)).any()]
    if not vectors:
        return Finding("output", False, "it estimates nothing: position, velocity and attitude are all None")
    covariance = "with" if trial.covariance is not None else "without"
    return Finding("output", True, f"{len(trial)} valid estimates of {', '.join(vectors)}, {covariance} covariance")


def _units(factory: Factory, recording: Recording) -> Finding:
    """Wrong units are off by a factor of 57 or more, or by a whole Earth: coarse limits will do."""
    first = _run(factory(), recording)[0]
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
    if first.velocity is not None and np.any(np.abs(np.where(mask[3:6], first.velocity - start.velocity, 0.0)) > 30.0):
        wrong.append(f"velocity {np.round(first.velocity, 2).tolist()} is over 30 m/s from the start's")
    if first.attitude is not None and mask[8]:
        turn = np.remainder(first.attitude[2] - start.attitude[2] + np.pi, 2.0 * np.pi) - np.pi
        if abs(first.attitude[2]) > 2.0 * np.pi or abs(turn) > 1.0:
            wrong.append(f"yaw {first.attitude[2]:g} is over a radian from the start's, {start.attitude[2]:g} rad")
    return Finding("units", not wrong, "; ".join(wrong) or "the first estimate is near the initial state")


def _determinism(factory: Factory, recording: Recording) -> Finding:
    where = _difference(_run(factory(), recording), _run(factory(), recording))
    return Finding("determinism", where is None, where or "two instances agree bit for bit on the same recording")


def _reset(factory: Factory, recording: Recording) -> Finding:
    fresh = _run(factory(), recording)
    used = factory()
    _run(used, contract_recording(1))
    where = _difference(fresh, _run(used, recording))
    sentence = (
        "after a run and a reset it is as good as new" if where is None else f"a run before reset() shows: {where}"
    )
    return Finding("reset", where is None, sentence)


def _causality(factory: Factory, recording: Recording) -> Finding:
    """All that comes after half of the run is changed; nothing before may notice."""
    changed = _altered(recording, _HALF)
    n = int(np.searchsorted(recording.data.truth.time, _HALF + 1e-6))
    where = _difference(_run(factory(), recording)[:n], _run(factory(), changed)[:n])
    ok = where is None
    return Finding("causality", ok, "estimates do not know later data" if ok else f"later data change it: {where}")


def _input(factory: Factory, recording: Recording) -> Finding:
    mine = copy.deepcopy(recording)
    before = _digests(mine)
    _run(factory(), mine)
    after = _digests(mine)
    spoilt = [name for name in before if before[name] != after[name]]
    ok = not spoilt
    return Finding("input", ok, "it leaves its input alone" if ok else f"it writes into: {', '.join(spoilt)}")


def _aliasing(factory: Factory, recording: Recording) -> Finding:
    estimator = factory()
    kept: list[tuple[Estimate, Estimate]] = []
    for estimate in _steps(estimator, recording):
        kept.append((estimate, copy.deepcopy(estimate)))
    where = _difference([a for a, _ in kept], [b for _, b in kept])
    ok = where is None
    return Finding(
        "estimates", ok, "later steps leave them alone" if ok else f"a later step writes into one (copy it): {where}"
    )


def _silence(factory: Factory, recording: Recording) -> Finding:
    """Every aiding instrument falls silent at half of the run; then the IMU, too."""
    for what, imu in (("every aiding instrument", True), ("every instrument", False)):
        trial = run_trial(factory(), _silenced(recording, _HALF, imu))
        if trial.status != "ok":
            return Finding("silence", False, f"when {what} falls silent: {trial.status}: {trial.reason}")
    return Finding("silence", True, "it carries on when the instruments fall silent")


def _missing(factory: Factory, recording: Recording) -> Finding:
    names = list(recording.instruments)
    needed: list[str] = []
    for absent in (["imu"], *([n] for n in names), names, [*names, "imu"]):
        trial = run_trial(factory(), _without(recording, absent))
        label = absent[0] if len(absent) == 1 else "all" if "imu" in absent else "all but the IMU"
        if trial.status not in ("ok", "unsuitable"):
            return Finding("missing instruments", False, f"without {label}: {trial.status}: {trial.reason}")
        if trial.status == "unsuitable" and not trial.reason:
            return Finding(
                "missing instruments", False, f"without {label}: UnsuitableScenario does not say what is needed"
            )
        if trial.status == "unsuitable":
            needed.append(label)
    sentence = f"without {', '.join(needed)} it says what it needs" if needed else "it works without any of them"
    return Finding("missing instruments", True, sentence)


def _steps(estimator: Estimator, recording: Recording) -> Iterable[Estimate]:
    if estimator.reference:
        estimator.reveal(recording)
    estimator.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        yield estimator.update(packet)


def _run(estimator: Estimator, recording: Recording) -> list[Estimate]:
    return [copy.deepcopy(e) for e in _steps(estimator, recording)]


def _difference(first: Sequence[Estimate], second: Sequence[Estimate]) -> str | None:
    """Where two series of estimates part, or None."""
    for a, b in zip(first, second, strict=True):
        for name in ("time", "position", "velocity", "attitude", "covariance", "estimated"):
            x, y = getattr(a, name), getattr(b, name)
            if (x is None) != (y is None) or (x is not None and not np.array_equal(x, y, equal_nan=True)):
                return f"{name} differs at {float(b.time):g} s"
    return None


def _altered(recording: Recording, after: float) -> Recording:
    """Other measurements after a time, and fewer."""
    data = recording.data
    imu = data.imu
    if imu is not None:
        late = imu.time > after + 1e-6
        imu = ImuSamples(
            imu.time,
            imu.interval,
            np.where(late[:, None], -imu.angular_rate, imu.angular_rate),
            np.where(late[:, None], imu.specific_force + 0.1, imu.specific_force),
        )
    aids = {}
    for name, stream in data.aids.items():
        late = stream.time > after + 1e-6
        small = 1e-6 if KINDS[stream.kind].geodetic else 0.1
        changed = replace(stream, value=np.where(late[:, None], stream.value + small, stream.value))
        aids[name] = _rows(changed, ~late | (np.arange(len(late)) % 3 > 0))
    return replace(recording, data=replace(data, imu=imu, aids=aids))


def _rows(stream: AidStream, keep: NDArray[np.bool_]) -> AidStream:
    columns = ("time", "value", "faults", "fault_error", "sigma")
    return replace(stream, **{c: getattr(stream, c)[keep] for c in columns})


def _silenced(recording: Recording, after: float, imu: bool) -> Recording:
    data = recording.data
    samples = data.imu
    if samples is not None and not imu:
        samples = samples[: int(np.searchsorted(samples.time, after + 1e-6))]
    aids = {n: _rows(s, s.time <= after + 1e-6) for n, s in data.aids.items()}
    return replace(recording, data=replace(data, imu=samples, aids=aids))


def _without(recording: Recording, absent: Sequence[str]) -> Recording:
    old = recording.instruments
    imu = "imu" not in absent
    sheets = Instruments([s for n, s in old.items() if n not in absent], old.imu if imu else None, old.step)
    data: Block = replace(
        recording.data,
        imu=recording.data.imu if imu else None,
        aids={n: s for n, s in recording.data.aids.items() if n not in absent},
    )
    return replace(recording, instruments=sheets, data=data)


def _digests(recording: Recording) -> dict[str, str]:
    parts: dict[str, Any] = {
        "the initial state": recording.start,
        "the datasheets": (recording.instruments.imu, list(recording.instruments.values())),
        "the IMU samples": recording.data.imu,
    }
    parts |= {f"the measurements of {n}": s.value for n, s in recording.data.aids.items()}
    return {name: hashlib.blake2b(pickle.dumps(part)).hexdigest() for name, part in parts.items()}
