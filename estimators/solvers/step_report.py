"""What a filter reports of its steps: the innovation of each instrument, its tests, and the noise that was chosen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.noise_report import CHOSEN, NoiseReport
from simnav.estimators.models.filtering import Readings, has_noise_chosen
from simnav.kernel_types import IntegerVector, Matrix, Vector
from simnav.records import Record
from simnav.structures import length, structure
from simnav.types import KINDS, Array, Instruments

from .innovation_consistency import TEST, add_square, begun_test, end_epoch, is_inconsistent

__all__ = ["StepReport", "begun_report", "end_report", "labels_of", "note_readings"]

#: Norm and normalised square of the last innovation of an instrument in a step.
INNOVATION = structure(norm=float, nis=float)
#: What a row of a report holds behind the innovations.
TESTS = ("skipped", "variance_factor", "inconsistent")
_TESTED = structure(**dict.fromkeys(TESTS, float))
_NUMBER_OF_TESTS = length(_TESTED)


class StepReport(Record):
    """What is reported of i instruments of a filter.

    Attributes
    ----------
    freedom : (i,) array of int
        Number of components of a reading.
    skipped : (1,) array
        Number of readings so far that could not be used.
    test : array
        The test of the innovations (`simnav.estimators.solvers.innovation_consistency`).
    chosen : (j, 4) array
        `simnav.estimators.adaptations.noise_report.NoiseReport.values`.
    index : (i,) array of int
        Row of each instrument in it; -1 where nothing is chosen.
    with_zero : bool
        Whether a number of 0 is reported.
    innovations : (2 i,) array
        `INNOVATION` of each instrument; NaN where there is none.
    """

    freedom: IntegerVector
    skipped: Vector
    test: Vector
    chosen: Matrix
    index: IntegerVector
    with_zero: bool
    innovations: Vector


def begun_report(
    instruments: Instruments, names: Sequence[str], skipped: Array, noise: NoiseReport | None
) -> StepReport:
    """What is reported of the instruments of these names, before the first step; ``noise`` has what a rule chooses."""
    of_run = list(instruments)
    return StepReport(
        freedom=np.array([len(KINDS[instruments[name].kind].limits) for name in names], np.int64), skipped=skipped,
        test=begun_test(), chosen=np.empty((0, length(CHOSEN))) if noise is None else noise.values,
        index=np.array([-1 if noise is None else of_run.index(name) for name in names], np.int64),
        with_zero=noise is not None and noise.with_zero,
        innovations=np.full(length(INNOVATION) * len(names), np.nan),
    )  # fmt: skip


def labels_of(names: Sequence[str]) -> list[str]:
    """What the numbers of a row are, for some instruments, without the chosen noise."""
    return [f"{what}.{name}" for name in names for what in ("innovation", "nis")] + [*TESTS]


@kernel
def note_readings(report: StepReport, readings: Readings, count: int) -> None:
    """Note what became of some readings."""
    for k in range(count):
        if readings.rejected[k]:
            continue
        row = readings.instrument[k]
        at = report.index[row]
        if at >= 0 and has_noise_chosen(readings, k):
            chosen = report.chosen[at].view(CHOSEN)[0]
            for a in range(3):
                chosen.sigma[a] = readings.sigma[k, a]
            if readings.reported[k] != 0.0 or report.with_zero:
                chosen.number = readings.reported[k]
        if readings.nis[k] < 0.0:
            report.skipped[0] += 1.0
            continue
        add_square(report.test, readings.nis[k], report.freedom[row])
        innovation = report.innovations.view(INNOVATION)[row]
        innovation.norm, innovation.nis = readings.size[k], readings.nis[k]


@kernel
def end_report(report: StepReport, row: Vector) -> None:
    """Test the innovations at the end of a step, and write all that is reported of it into a row.

    Parameters
    ----------
    report : StepReport
        Updated.
    row : (2 i + 3 + 4 j,) array
        Overwritten: the innovations, `TESTS`, and the chosen noise.
    """
    end_epoch(report.test)
    n, (j, width), end = report.innovations.size, report.chosen.shape, report.innovations.size + _NUMBER_OF_TESTS
    for a in range(n):
        row[a], report.innovations[a] = report.innovations[a], np.nan
    tested = row[n:end].view(_TESTED)[0]
    tested.skipped, tested.variance_factor = report.skipped[0], report.test.view(TEST)[0].variance_factor
    tested.inconsistent = 1.0 if is_inconsistent(report.test) else 0.0
    for a in range(j):
        for b in range(width):
            row[end + width * a + b] = report.chosen[a, b]
