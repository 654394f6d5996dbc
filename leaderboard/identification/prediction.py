"""How far ahead a datasheet can be trusted: the position after a time without fixes, predicted and found.

Innovations from reading to reading hardly see an error that wanders over minutes, and an outage of the fixes is made of
nothing else. So fixes are taken away for a while, and the prediction is compared with the first that comes back: with
its innovation v and covariance S, the logarithm of the likelihood of all of them is ``-1/2 sum (v' S^-1 v + log det
S)``, as of innovations, at a lag of a minute. Where a log has a reference, v is the error of the position against it,
before the fixes go, and in the middle and at the end of the time without them; S is its covariance. The errors that
wander are enlarged, one after the other, as long as this makes the predictions more likely, and until they are not
further off than they say (`Predictions.allowed`). They are never made smaller.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from simnav.geometry.earth import relative_position
from simnav.kinds import BODY_VELOCITY, HEADING, WATER_SPEED
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.sensors.faults import Outage, build_layers
from simnav.types import Array, Datasheet, ImuDatasheet, TriadDatasheet

from .assumption import Assumption
from .choices import fitted_aids
from .innovations import Likelihood

__all__ = ["AWAY", "Judged", "Predictions", "widened"]

#: Lengths of the times without fixes and with them [s], in a run of their own for each place at which they begin.
AWAY = 60.0
_THERE, _PLACES = 20.0, (10.0, 37.0, 64.0)
#: Fewer predictions say nothing; so many times without fixes are taken to be there at least.
_LEAST, _FEWEST = 4, 3
#: By so much a larger error makes the predictions more likely, to be used.
_GAIN = 1.0
#: Sizes that are tried, as multiples of the white noise (of the turn-on bias of an IMU); correlation time if none [s].
_SIZES, _TIME = (0.25, 0.5, 1.0, 2.0, 4.0), 100.0
#: Errors that are enlarged at most.
_MOST = 3


@dataclass(frozen=True)
class _Wander:
    """An error that wanders: of an aid, or of a triad of the IMU."""

    instrument: str
    figure_of: str

    def enlarged(self, assumed: Assumption, times: float) -> Assumption:
        """With an in-run bias that is added to what the datasheet says."""
        if self.figure_of == "imu":
            return assumed.with_imu(lambda imu: self._triad(imu, times))
        return assumed.with_sheet(self.instrument, lambda sheet: _sheet(sheet, times))

    def _triad(self, imu: ImuDatasheet, times: float) -> ImuDatasheet:
        triad: TriadDatasheet = getattr(imu, self.instrument)
        size = float(np.hypot(triad.bias_instability, times * triad.bias))
        time = triad.correlation_time if triad.bias_instability else _TIME
        return replace(imu, **{self.instrument: replace(triad, bias_instability=size, correlation_time=time)})  # type: ignore[arg-type]


def _sheet(sheet: Datasheet, times: float) -> Datasheet:
    size = np.hypot(sheet.bias_instability, times * sheet.sigma)
    time = sheet.correlation_time if sheet.bias_instability.any() else _TIME
    return replace(sheet, bias_instability=size, correlation_time=time)


class Judged(NamedTuple):
    """How well predictions fit.

    Attributes
    ----------
    log_likelihood : float
        The logarithm of their likelihood; 0 if they are too few.
    nis : float
        The mean of their NIS, over its expectation.
    """

    log_likelihood: float
    nis: float


class Predictions:
    """Predictions of positions after times without fixes.

    Parameters
    ----------
    recording : Recording
        The recording.
    until : float
        Readings after this time are not used [s].
    reference : bool
        Whether the recording's truth is a reference of the log, with which positions are compared.
    """

    def __init__(self, recording: Recording, until: float, reference: bool):
        self._fixes = [n for n, s in recording.instruments.items() if s.role == "fix" and not s.channels]
        self._reference = recording.data.truth if reference else None
        self._runs: list[tuple[Likelihood, Array]] = []
        for first in _PLACES if self._fixes else _PLACES[:1] if reference else ():
            begin = np.arange(first, until - AWAY, AWAY + _THERE)
            if len(begin):
                without = self._without_fixes(recording, begin)
                times = np.add.outer(begin, (0.0, 0.5 * AWAY, AWAY)).ravel()
                self._runs.append((Likelihood(without, until, times if reference else None), begin + AWAY))

    def _without_fixes(self, recording: Recording, begin: Array) -> Recording:
        if not self._fixes:
            return recording
        outage = Outage(instruments=tuple(self._fixes), intervals=tuple((t, t + AWAY) for t in begin.tolist()))
        aids = dict(recording.data.aids)
        for layer in build_layers([outage], recording.seed):
            aids = {n: layer.laid_over(s) for n, s in aids.items()}
        return replace(recording, data=replace(recording.data, aids=aids))

    def found(self, assumed: Assumption) -> list[tuple[Array, Array]]:
        """Horizontal errors of the predictions and their covariances."""
        runs = self._against_fixes if self._reference is None else self._against_reference
        return [pair for likelihood, ends in self._runs for pair in runs(likelihood, ends, assumed)]

    def _against_fixes(self, likelihood: Likelihood, ends: Array, assumed: Assumption) -> Iterator[tuple[Array, Array]]:
        streams = likelihood.innovations(assumed, heading=False)
        for stream in (streams[n] for n in self._fixes if n in streams):
            rows = np.searchsorted(stream.time, ends - 1e-6)
            for row in rows[rows < len(stream.time)].tolist():
                yield stream.value[row, :2], stream.covariance[row, :2, :2]

    def _against_reference(
        self, likelihood: Likelihood, _: Array, assumed: Assumption
    ) -> Iterator[tuple[Array, Array]]:
        truth = self._reference
        assert truth is not None
        for time, estimate in likelihood.estimates(assumed):
            row = int(np.argmin(np.abs(truth.time - time)))
            assert estimate.position is not None
            error = relative_position(estimate.position[None], truth.position[row : row + 1])[0, :2]
            if estimate.covariance is not None and np.isfinite(error).all() and abs(truth.time[row] - time) < 0.5:
                yield error, estimate.covariance[:2, :2]

    def judged(self, assumed: Assumption) -> Judged:
        """How well they fit."""
        pairs = self.found(assumed)
        if len(pairs) < _LEAST:
            return Judged(0.0, 0.0)
        value, spread = (np.array(part) for part in zip(*pairs, strict=True))
        nis = np.einsum("ni,nij,nj->n", value, np.linalg.inv(spread), value)
        total = -0.5 * float(np.sum(nis + np.linalg.slogdet(spread)[1]))
        return Judged(total, 0.5 * float(nis.mean())) if np.isfinite(total) else Judged(-np.inf, np.inf)

    @property
    def allowed(self) -> float:
        """The largest mean of NIS / 2: 1 less what the variance of so few times without fixes does not tell.

        The squares of n times of two components tell a variance with 2n degrees of freedom, and the error of one more
        is distributed as Student's t, whose variance is larger by 2n / (2n - 2).
        """
        times = max((len(ends) for _, ends in self._runs), default=0)
        return 1.0 - 1.0 / max(times, _FEWEST)


def _wanderers(scenario: Scenario, assumed: Assumption) -> Iterator[_Wander]:
    for name, sheet in fitted_aids(scenario, assumed).items():
        may = "bias_instability" in type(scenario.aids[name]).model_fields and not sheet.processes
        if may and (sheet.equation in (BODY_VELOCITY, WATER_SPEED, HEADING) or sheet.role == "fix"):
            yield _Wander(name, "aid")
    if assumed.instruments.imu is not None:
        yield from (_Wander(name, "imu") for name in ("gyroscope", "accelerometer"))


def widened(scenario: Scenario, predictions: Predictions, assumed: Assumption) -> list[tuple[str, Assumption]]:
    """Enlarge the errors that wander until the predictions are as far off as they say.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    predictions : Predictions
        Those of the log.
    assumed : Assumption
        The datasheets to begin with.

    Returns
    -------
    list of (str, Assumption)
        The instruments or triads whose errors were enlarged, in order, each with the assumption then.
    """
    steps: list[tuple[str, Assumption]] = []
    left, now = list(_wanderers(scenario, assumed)), predictions.judged(assumed)
    while now.log_likelihood and left and len(steps) < _MOST:
        tries = [(w, a, predictions.judged(a)) for w in left for a in (w.enlarged(assumed, times) for times in _SIZES)]
        best = max(tries, key=lambda t: t[2].log_likelihood)
        if best[2].log_likelihood - now.log_likelihood < _GAIN:
            if now.nis <= predictions.allowed:
                break
            wide = [t for t in tries if t[2].nis <= predictions.allowed]
            best = max(wide, key=lambda t: t[2].log_likelihood) if wide else min(tries, key=lambda t: t[2].nis)
            if best[2].nis >= now.nis:
                break
        wander, assumed, now = best
        left.remove(wander)
        steps.append((wander.instrument, assumed))
    return steps
