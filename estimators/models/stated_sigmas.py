"""Readings that state their own sigma: models take it in place of that of the datasheet.

An instrument whose `Datasheet.stated` is true delivers with each reading the standard deviation of its white noise, as
the instrument says (`simnav.types.Measurement.side`). Then the variance of the datasheet in the noise of a model is
exchanged for that of the reading; what a model adds to it stays. A reading that states none has that of the datasheet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from simnav.types import Array, Instruments, Measurement

from .base import ErrorModel, Linearised
from .chain import Chain
from .filtering import ModelFunctions

__all__ = ["with_stated_sigmas"]

M = TypeVar("M")


class _Stated(ErrorModel):
    """What a model does otherwise where a reading states its sigma."""

    #: Variances of the datasheet, by the name of the instrument.
    stated_variances: Mapping[str, Array]

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy makes the class, too, because no module has it."""
        return _blank, (type(self).__bases__[1],), self.__dict__

    def _states(self, m: Measurement) -> bool:
        return m.instrument in self.stated_variances and len(m.side) == len(m.value)

    def measure(self, measurement: Measurement) -> Linearised | None:
        found = super().measure(measurement)  # type: ignore[safe-super]
        if found is None or not self._states(measurement):
            return found
        d = len(found.noise)
        own = np.square(measurement.side[:d])
        noise = np.array(found.noise)
        # A model that has noise of its own in place of the datasheet's takes at least the stated one.
        diagonal = np.maximum(np.diag(noise) - self.stated_variances[measurement.instrument][:d] + own, own)
        np.fill_diagonal(noise, diagonal)
        return found._replace(noise=noise)

    def nominal_noise(self, measurement: Measurement) -> Array | None:
        if not self._states(measurement):
            return super().nominal_noise(measurement)
        return ErrorModel.nominal_noise(self, measurement)

    def nominal_noises(self, measurements: Sequence[Measurement]) -> Array | None:
        return None if any(map(self._states, measurements)) else super().nominal_noises(measurements)

    def functions(self) -> ModelFunctions | None:
        return None if self.stated_variances else super().functions()

    def functions_of(self, name: str) -> ModelFunctions | None:
        return None if name in self.stated_variances else super().functions_of(name)

    def measure_together(self, measurements: Sequence[Measurement]) -> Linearised | None:
        return None if any(map(self._states, measurements)) else super().measure_together(measurements)


@lru_cache(maxsize=64)
def _stated_class(kind: type[object]) -> type[Any]:
    return type(f"Stated{kind.__name__}", (_Stated, kind), {"__module__": __name__})


def _blank(kind: type[object]) -> Any:
    found: type[Any] = _stated_class(kind)  # type: ignore[arg-type]  # mypy: a class of Any has no hash
    return object.__new__(found)


def with_stated_sigmas(model: M, instruments: Instruments) -> M:
    """A model that takes the sigmas that readings state; itself where no instrument states any.

    Parameters
    ----------
    model : ErrorModel or Chain
        The model, or the chain of one; it is changed in place.
    instruments : Instruments
        Datasheets of the run's instruments.
    """
    stated = {name: np.square(sheet.sigma) for name, sheet in instruments.items() if sheet.stated}
    if isinstance(model, Chain):
        with_stated_sigmas(model.front, instruments)
    elif isinstance(model, _Stated):
        model.stated_variances = stated
    elif stated and isinstance(model, ErrorModel):
        model.__class__ = _stated_class(type(model))
        model.stated_variances = stated  # type: ignore[attr-defined]
    return model
