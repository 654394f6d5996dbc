"""Noise figures for the datasheets of a log, from the innovations of a filter: those with which they are as large as it
expects.

The normalised innovation squared (NIS) of a reading with d components has the median of chi-square with d degrees of
freedom where noise and covariance agree (Y. Bar-Shalom, X. R. Li and T. Kirubarajan, "Estimation with Applications to
Tracking and Navigation", section 5.4). The sigma of each instrument is multiplied until it has; the median is not
moved by outliers. Innovations that are not white come in runs: then the NIS of neighbours correlates, for one component
by the square of the correlation of the innovations.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from simnav.estimator import make
from simnav.log.noise_figures import Figure
from simnav.log.table import LogError
from simnav.source import record
from simnav.spec import UNITS
from simnav.trial import run_trial
from simnav.types import KINDS, Array, Instruments

if TYPE_CHECKING:
    from simnav.recording import Recording
    from simnav.scenario import Scenario

__all__ = ["innovation_figures"]

#: The filters: with an IMU, and without one.
_ROWS = ("ekf", "ship-ekf")
#: Runs of the filter, and the factor of all of them together at most, either way.
_RUNS, _LARGEST = 6, 100.0
#: A factor that changes by less than this part is settled.
_SETTLED = 0.02
#: Fewer readings say nothing.
_LEAST = 20
#: From this correlation of neighbours on it is said that part of the error is coloured.
_COLOURED = 0.3


def innovation_figures(scenario: Scenario, seed: int = 0) -> list[Figure]:
    """Figures for the datasheets of a log, with which the innovations of a filter have the size that it expects.

    Parameters
    ----------
    scenario : Scenario
        With a ``[log]``.
    seed : int
        Number of the recording.

    Returns
    -------
    list of Figure
        One for each instrument with enough readings.

    Raises
    ------
    LogError
        If the filter cannot run on the log.
    """
    recording = record(scenario, seed)
    row = _ROWS[0] if recording.instruments.imu is not None else _ROWS[1]
    factors = dict.fromkeys(recording.instruments, 1.0)
    nis: dict[str, Array] = {}
    for _ in range(_RUNS):
        trial = run_trial(make(row), _scaled(recording, factors))
        if trial.status != "ok":
            raise LogError(f"{row} ends with {trial.status} on this log ({trial.reason}), so it has no innovations")
        nis = {n: found for n in factors if len(found := _of(trial.diagnostics.get(f"nis.{n}"))) >= _LEAST}
        moved = 0.0
        for name, values in nis.items():
            d = len(KINDS[recording.instruments[name].kind].components)
            step = float(np.sqrt(max(np.median(values), 1e-12) / _chi_square_median(d)))
            new = float(np.clip(factors[name] * step, 1.0 / _LARGEST, _LARGEST))
            moved = max(moved, abs(new / factors[name] - 1.0))
            factors[name] = new
        if moved < _SETTLED:
            break
    return [_figure(recording, row, name, factors[name], values) for name, values in nis.items()]


def _scaled(recording: Recording, factors: dict[str, float]) -> Recording:
    known = recording.instruments
    sheets = [replace(s, sigma=factors[n] * s.sigma) for n, s in known.items()]
    return replace(recording, instruments=Instruments(sheets, known.imu, known.step))


def _of(values: Array | None) -> Array:
    """The NIS of the readings that were used."""
    return np.empty(0) if values is None else np.asarray(values, dtype=np.float64)[np.isfinite(values)]


def _chi_square_median(d: int) -> float:
    from scipy.stats import chi2

    return float(chi2.median(d))


def _figure(recording: Recording, row: str, name: str, factor: float, nis: Array) -> Figure:
    sheet = recording.instruments[name]
    unit = KINDS[sheet.kind].components[0].error_unit
    now = tuple(float(v) / UNITS.get(unit, 1.0) for v in np.atleast_1d(sheet.sigma))
    from scipy.stats import spearmanr

    neighbours = float(spearmanr(nis[1:], nis[:-1]).statistic)
    correlation = np.sqrt(neighbours) if neighbours > 0.0 else 0.0
    basis = f"the NIS of {len(nis)} innovations of {row} is then that of white noise, on the median"
    if correlation > _COLOURED:
        basis += (
            f"; but neighbours correlate by about {correlation:.1f}, so part of the error is coloured: declare it "
            "(bias_instability, or [[instruments.NAME.error]])"
        )
    return Figure(f"instruments.{name}.sigma_{unit}", tuple(factor * v for v in now), now, basis)
