"""How failures begin: a jump or a repeated reading is sudden, what grows through all sizes is not."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.onset import add_to_onset, no_onsets
from simnav.types import Datasheet, ImuDatasheet, Instruments, Measurement, TriadDatasheet
from tests.cases.judged_predictions import JudgedPredictions

LIMIT = 16.27  # chi-square of 3 degrees of freedom, 0.999


def sudden(innovations: np.ndarray, values: np.ndarray | None = None) -> bool:
    """Whether the failures that last until the end began at once."""
    onsets = no_onsets(1)
    for k, u in enumerate(innovations):
        value = np.array([float(k)]) if values is None else values[k]
        add_to_onset(onsets, 0, *u, value, float(u @ u) > LIMIT)
    return bool(onsets.sudden[0])


def course(rng: np.random.Generator, size, count: int = 60) -> np.ndarray:
    """Innovations of unit noise with a mean of ``size(k)`` in a fixed direction, from the 30th on."""
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    mean = np.array([size(k - 30) if k >= 30 else 0.0 for k in range(count)])
    return np.asarray(rng.standard_normal((count, 3)) + mean[:, None] * direction)


@pytest.mark.parametrize("size", [6.0, 10.0, 40.0])
def test_a_jump_is_sudden(size: float):
    rng = np.random.default_rng(0)
    assert np.mean([sudden(course(rng, lambda k: size)) for _ in range(400)]) > 0.9


@pytest.mark.parametrize("slope", [0.05, 0.1, 0.2])
def test_what_grows_is_not(slope: float):
    rng = np.random.default_rng(1)
    count = 30 + int(12.0 / slope)
    assert np.mean([sudden(course(rng, lambda k: slope * k, count)) for _ in range(400)]) < 0.1


def test_a_gross_error_before_does_not_decide():
    """What counts is the first failure after `BEFORE` passed tests, and not the ones that follow it."""
    grown, outlier = np.zeros((40, 3)), np.array([9.0, 0.0, 0.0])
    grown[20:, 1] = 0.5 * np.arange(20)
    grown[8] = outlier
    assert not sudden(grown)
    assert sudden(grown[:12])


def test_a_reading_that_repeats_itself_is_sudden():
    grown = np.zeros((40, 3))
    grown[10:, 1] = 0.3 * np.arange(30)
    frozen = np.tile([1.0, 2.0, 3.0], (40, 1))
    assert not sudden(grown)
    assert sudden(grown, frozen)
    frozen[:, 2] += np.arange(40)  # one component goes on
    assert not sudden(grown, frozen)


def believed(says, count: int = 40) -> list[bool]:
    """Whether a log of 1 Hz is believed against the prediction, with a sound fix every 5 s."""
    sheets = Datasheet("fix", "gnss_position", 0.2, np.ones(3)), Datasheet("dvl", "dvl", 1.0, np.ones(3))
    test = JudgedPredictions(Instruments(sheets, ImuDatasheet(100.0, TriadDatasheet(), TriadDatasheet())))
    rng, found = np.random.default_rng(2), []
    for k in range(count):
        u, value = rng.standard_normal(3) + says(k), rng.standard_normal(3)
        log = Measurement(float(k), "dvl", "dvl", value)
        found.append(test.fails(Innovation(log, u, 0.01 * np.eye(3), np.eye(3))))
        if k % 5 == 4:
            fix = Measurement(k + 0.5, "fix", "gnss_position", np.zeros(3))
            test.fails(Innovation(fix, rng.standard_normal(3), 0.5 * np.eye(3), np.eye(3)))
    return found


def test_a_log_is_believed_beside_a_sound_witness_if_its_failures_grew():
    """A gyroscope with a new bias turns the heading little by little; fixes every 5 s see it late."""
    assert all(believed(lambda k: np.array([0.0, 0.4 * max(k - 10, 0), 0.0]))[30:])
    assert not any(believed(lambda k: np.array([0.0, 8.0 * (k >= 10), 0.0]))[20:])
