"""The rows of the leaderboard: each a declaration of a solver and its pieces (`simnav.estimators.composition`).

A file in this folder is imported with the package: a new row needs no entry elsewhere.
"""

from importlib import import_module
from pkgutil import iter_modules

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
