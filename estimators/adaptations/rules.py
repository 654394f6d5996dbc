"""Rules: the functions by which adaptations choose the noise of a reading.

A rule is called ``rule(settings, memory, common, readings, k, prediction)``. It receives its settings and its memory
for an instrument, what it keeps of all instruments together, the readings of the step with the index k of this one, and
a `Prediction`: the innovation, H P H' and the nominal R. It updates its memories, overwrites ``prediction.noise`` with
the noise to be used, and returns a number to be reported, or 0. It may also set ``readings.rejected[k]``, and
``readings.inflation[k]``, the factor on P.

Settings and memories are structures (`simnav.structures`), so that a rule reads their numbers by name. A new rule is
one such function, a kernel with ``passed=True`` or plain Python, in a class that says its settings and its memory
(`simnav.estimators.adaptations.noise.NoiseAdaptation`).
"""

from __future__ import annotations

from simnav.compiled import helper
from simnav.kernel_types import Matrix

__all__ = ["copied"]


@helper
def copied(noise: Matrix, used: Matrix) -> None:
    """Copy an (m, m) array into another; a slice would take seconds to compile."""
    for i in range(noise.shape[0]):
        for j in range(noise.shape[0]):
            used[i, j] = noise[i, j]
