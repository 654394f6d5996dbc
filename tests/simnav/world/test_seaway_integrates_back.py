"""Ideal samples in a seaway, integrated by python-ins; `tests.audit.seaway` does the same for an hour."""

from __future__ import annotations

import numpy as np

from tests.audit.seaway import PROMISED, travelled


def test_python_ins_stays_within_the_bound_of_the_hour():
    """Errors of an integration of random motion grow with the root of the time: after an hour 5 cm."""
    away = travelled(240.0)
    assert (away < PROMISED * np.sqrt(60.0 * np.arange(1.0, 5.0) / 3600.0)).all()
    assert away.max() > 1e-6  # they are two mechanizations
