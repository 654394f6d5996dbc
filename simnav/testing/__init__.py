"""For test suites of estimators: the contract as parametrised checks, recordings as fixtures, and the cost of an epoch.

- `parametrize_with_checks` makes one test of each check of the contract and each estimator.
- `simnav.testing.fixtures` has pytest fixtures; ``pytest_plugins = ["simnav.testing.fixtures"]`` in ``conftest.py``
  switches them on.
- `parametrize_with_rows` makes a pytest-benchmark group of an estimator and rows that come with simnav.
- `measure` measures time and memory of an epoch of several estimators in turns; ``simnav bench`` prints it.
- `multiple` measures the processor time of one estimator as a multiple of that of another one.

pytest is imported when a decorator is used, and not before: simnav itself does not need it.
"""

from __future__ import annotations

from simnav.testing.cost import Cost, measure
from simnav.testing.estimator_forms import EstimatorLike
from simnav.testing.paired_time import Multiple, multiple
from simnav.testing.parametrize import parametrize_with_checks, parametrize_with_rows

__all__ = [
    "Cost",
    "EstimatorLike",
    "Multiple",
    "measure",
    "multiple",
    "parametrize_with_checks",
    "parametrize_with_rows",
]
