"""The contract of estimators, and their registration, search and construction.

An estimator is a class with two methods, `Estimator.reset` and `Estimator.update`. It is registered
by the decorator `register`, found through the entry-point group ``simnav.estimators`` of an installed
package, or by the path of its file (``my_filter.py`` or ``my_filter.py:MyFilter``).

Entry points are loaded when a name is searched for the first time. If one of them fails, a warning names it.
"""

from __future__ import annotations

from simnav.estimator.contract import Estimator, EstimatorError, UnsuitableScenario
from simnav.estimator.lookup import Description, describe, find, make
from simnav.estimator.needs import Needs, NeedsError, checked_needs, lacking
from simnav.estimator.parameters import Parameter
from simnav.estimator.registry import GROUP, names, register
from simnav.estimator.suitability import unsuitable, unused_positions

__all__ = [
    "GROUP",
    "Description",
    "Estimator",
    "EstimatorError",
    "Needs",
    "NeedsError",
    "Parameter",
    "UnsuitableScenario",
    "checked_needs",
    "describe",
    "find",
    "lacking",
    "make",
    "names",
    "register",
    "unsuitable",
    "unused_positions",
]
