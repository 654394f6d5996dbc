"""What an estimator is, and how it is registered, found and made.

An estimator is a class with two methods, `Estimator.reset` and `Estimator.update`. It becomes known
by the decorator `register`, through the entry-point group ``simnav.estimators`` of an installed
package, or by the path of its file (``my_filter.py`` or ``my_filter.py:MyFilter``).

Entry points are loaded when a name is first asked for; one that fails is named in a warning.
"""

from __future__ import annotations

from simnav.estimator.contract import Estimator, EstimatorError, UnsuitableScenario
from simnav.estimator.lookup import Description, describe, find, make
from simnav.estimator.needs import Needs, NeedsError, checked_needs, lacking
from simnav.estimator.parameters import Parameter
from simnav.estimator.registry import GROUP, names, register

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
]
