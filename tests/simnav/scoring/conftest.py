"""A small recording, and trials with given errors, for all tests of scores."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from simnav.recording import Recording
from simnav.trial import Trial
from tests.cases import given_errors


@pytest.fixture
def make_recording() -> Callable[..., Recording]:
    return given_errors.make_recording


@pytest.fixture
def make_trial() -> Callable[..., Trial]:
    return given_errors.make_trial


@pytest.fixture
def recording() -> Recording:
    return given_errors.make_recording()
