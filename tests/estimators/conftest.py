"""The closed-form voyage, for all tests of estimators."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from simnav.recording import Recording
from tests.cases.closed_form import make_recording, run


@pytest.fixture(scope="session")
def recording_of() -> Callable[..., Recording]:
    """`make_recording`."""
    return make_recording


@pytest.fixture(scope="session")
def run_over() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """`run`."""
    return run
