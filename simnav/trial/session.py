"""Run an estimator over a recording, step by step, in this or in another process."""

from __future__ import annotations

import copy
import inspect
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from simnav.estimator import Estimator, NeedsError, UnsuitableScenario, lacking, unused_positions
from simnav.estimator.looking_back import inner_of
from simnav.recording import Recording
from simnav.steps import Steps
from simnav.trial.log import DivergedError, TrialLog
from simnav.trial.trial import Trial
from simnav.trial.wire import EstimateEncoder, InvalidOutputError, PacketDecoder, PacketEncoder
from simnav.types import NavigationStates

__all__ = [
    "TOGETHER",
    "FailureError",
    "LostError",
    "Session",
    "answers_to",
    "describe_failure",
    "run_session",
    "run_trial",
]


#: So many steps are handed over together, where an estimator may have them together.
TOGETHER = 64


class FailureError(Exception):
    """A session in another process reports that the estimator failed.

    Parameters
    ----------
    status : str
        ``error``, ``invalid-output``, ``out-of-memory`` or ``unsuitable`` (it refuses).
    reason : str
        The reason, as text for people.
    """

    def __init__(self, status: str, reason: str):
        super().__init__(reason)
        self.status, self.reason = status, reason


class LostError(Exception):
    """A session in another process reports that the process of the estimator has ended."""


class Session(Protocol):
    """The run of one estimator, in this or in another process.

    Attributes
    ----------
    name : str
        Registered name of the estimator, or the name of its class.
    observed : object
        The value of `Estimator.observes` for the instruments of the run, from `begin` on.
    """

    name: str
    observed: Any

    @property
    def needs(self) -> Any:
        """The value of `Estimator.needs`."""
        ...

    def begin(self, recording: Recording, packets: PacketEncoder) -> None:
        """Start the run: call `Estimator.observes` and `Estimator.reset`."""
        ...

    def run(self, packets: PacketEncoder, log: TrialLog) -> None:
        """Send one packet after the other, each after the answer to the last one, and log the answers."""
        ...

    def smooth(self) -> NavigationStates | None:
        """After the last step: `Estimator.smooth`."""
        ...

    def describe(self, error: BaseException) -> str:
        """The description of an exception of the estimator."""
        ...


def run_trial(estimator: Estimator, recording: Recording, *, keep_covariance: bool = True) -> Trial:
    """Run an estimator over a recording, in this process.

    Campaigns run estimators in other processes, with the same steps and the same bytes, so the numbers are the same.

    Parameters
    ----------
    estimator : Estimator
        The estimator. A reference receives the recording with the truth first.
    recording : Recording
        The recording. It is not changed, also if the estimator writes into its input.
    keep_covariance : bool
        False: covariances are checked but not kept, which saves 648 bytes an epoch.

    Returns
    -------
    Trial
        Never raises for what the estimator does; `KeyboardInterrupt` passes.
    """
    log = TrialLog(recording.data.truth, keep_covariance)
    return run_session(_LocalSession(estimator), recording, log)


def run_session(session: Session, recording: Recording, log: TrialLog) -> Trial:
    """Run an estimator over a recording, in this or in another process.

    Parameters
    ----------
    session : Session
        The session of the estimator.
    recording : Recording
        The run; its packets are sent one by one.
    log : TrialLog
        A new, empty log.

    Returns
    -------
    Trial
        Nothing is raised for what the estimator does.

    Raises
    ------
    LostError
        If the session raises it, and no earlier answer was invalid.
    """
    status, reason = "ok", ""
    reset_seconds = smooth_seconds = 0.0
    smoothed = None
    where = "reset()"
    ends = recording.data.truth.time
    packets = PacketEncoder(recording.data, ends)
    try:
        lack = lacking(session.needs, recording.instruments)
        if lack:
            return log.trial(session.name, "unsuitable", lack)
        started = time.perf_counter()
        session.begin(recording, packets)
        reset_seconds = time.perf_counter() - started
        if unused := unused_positions(session.observed, recording.instruments):
            return log.trial(session.name, "unsuitable", unused)
        where = ""
        try:
            session.run(packets, log)
        except (Exception, SystemExit):
            log.settle()  # what failed before counts
            raise
        log.settle()
        log.check_covariances()
        where = "smooth()"
        started = time.perf_counter()
        smoothed = log.trajectory(session.smooth())
        smooth_seconds = time.perf_counter() - started
    except LostError:
        raise
    except (Exception, SystemExit) as error:
        status, reason = _failure(error, session, where or f"update() at {ends[min(log.step, len(ends) - 1)]:g} s")
    if status != "ok":
        try:
            log.check_covariances()
        except InvalidOutputError as error:  # it came before the other failure
            status, reason = "invalid-output", f"update(): {error}"
    try:
        trial = log.trial(session.name, status, reason)
    except MemoryError:
        log.forget_diagnostics()
        trial = log.trial(session.name, "out-of-memory", "the arrays of its diagnostics do not fit into memory")
    return replace(trial, smoothed=smoothed, reset_seconds=reset_seconds, smooth_seconds=smooth_seconds)


def _failure(error: BaseException, session: Session, where: str) -> tuple[str, str]:
    """Status and reason."""
    if isinstance(error, DivergedError):
        return "diverged", f"{where}: {error}"
    if isinstance(error, InvalidOutputError):
        return "invalid-output", f"{where}: {error}"
    if isinstance(error, NeedsError):
        return "error", str(error)
    if isinstance(error, UnsuitableScenario) or (isinstance(error, FailureError) and error.status == "unsuitable"):
        return "error", f"{where}: it refuses a scenario that has all instruments that its needs name ({error})"
    if isinstance(error, FailureError):
        return error.status, f"{where}: {error.reason}"
    return "out-of-memory" if isinstance(error, MemoryError) else "error", f"{where}: {session.describe(error)}"


class _LocalSession:
    """An estimator of this process."""

    def __init__(self, estimator: Estimator):
        self.estimator = estimator
        self.name = estimator.name or type(estimator).__name__
        self.observed: Any = None
        self._encode = EstimateEncoder()
        self._decode = PacketDecoder(())

    @property
    def needs(self) -> Any:
        return self.estimator.needs

    def begin(self, recording: Recording, packets: PacketEncoder) -> None:
        self._decode = PacketDecoder(packets.streams)
        if self.estimator.reference:
            self.estimator.reveal(recording)
        self.observed = self.estimator.observes(copy.deepcopy(recording.instruments))
        self.estimator.reset(copy.deepcopy(recording.start), copy.deepcopy(recording.instruments))

    def run(self, packets: PacketEncoder, log: TrialLog) -> None:
        size = TOGETHER if type(self.estimator).update_all is not Estimator.update_all else 1
        for first in range(0, len(packets), size):
            steps = self._decode(bytearray(b"".join(packets.of(first, min(first + size, len(packets))))))
            for answers, seconds in answers_to(self.estimator, steps, self._encode):
                for answer in answers:
                    log.put(answer, seconds)
                log.settle()

    def smooth(self) -> NavigationStates | None:
        return self.estimator.smooth()

    def describe(self, error: BaseException) -> str:
        return describe_failure(error, self.estimator, skip=2)


def answers_to(estimator: Estimator, steps: Steps, encode: EstimateEncoder) -> Iterator[tuple[list[bytes], float]]:
    """The answers of an estimator to some steps: all by one call, if it takes them together, or one by one.

    Parameters
    ----------
    estimator : Estimator
        The estimator.
    steps : Steps
        What it receives.
    encode : EstimateEncoder
        That of the run.

    Yields
    ------
    answers : list of bytes
        In the form of `simnav.trial.wire`, of successive steps.
    seconds : float
        Wall time of each of them [s].
    """
    started = time.perf_counter_ns()
    together = estimator.update_all(steps) if len(steps) > 1 else None
    if together is not None:
        yield encode.each(together), 1e-9 * (time.perf_counter_ns() - started) / len(steps)
        return
    for measurements in steps:
        started = time.perf_counter_ns()
        estimate = estimator.update(measurements)
        seconds = 1e-9 * (time.perf_counter_ns() - started)
        yield [encode(estimate)], seconds


def describe_failure(error: BaseException, estimator: Estimator, skip: int) -> str:
    """Type, message and place of an exception: the innermost line in the estimator's own file, else the innermost.

    Parameters
    ----------
    error : BaseException
        What the estimator raised.
    estimator : Estimator
        Whose file is looked for in the traceback.
    skip : int
        How many frames are of those who called the estimator.
    """
    frames: Sequence[traceback.FrameSummary] = traceback.extract_tb(error.__traceback__)[skip:]
    try:
        own = Path(inspect.getfile(type(inner_of(estimator)))).name
    except (OSError, TypeError):
        own = ""
    inside = [f for f in frames if Path(f.filename).name == own] or list(frames)
    place = f" ({Path(inside[-1].filename).name}:{inside[-1].lineno} in {inside[-1].name})" if inside else ""
    try:
        message = " ".join(str(error).split())
    except Exception:
        message = ""
    return f"{type(error).__name__}{': ' if message else ''}{message[:500]}{place}"
