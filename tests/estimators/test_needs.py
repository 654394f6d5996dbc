"""What each row declares to need is what it refuses to work without, and nothing else."""

from __future__ import annotations

import copy
import dataclasses
import itertools
from collections.abc import Iterator

import pytest

from simnav.estimator import UnsuitableScenario, checked_needs, lacking, make, names
from simnav.recording import Recording
from simnav.testing.contract_check import contract_recording
from simnav.types import Instruments
from tests.cases.sorts_of_rows import first_of_each_solver

#: One row of each solver and model: what a row needs follows from its pieces.
FIRST = set(first_of_each_solver())


@pytest.fixture(scope="module")
def recording() -> Recording:
    return contract_recording(0)


def subsets(instruments: Instruments, pairs: bool) -> Iterator[Instruments]:
    """All instruments, none, each alone, and all but one, with the IMU and without; and pairs.

    The pairs are those of instruments without channels and states of their own: no row asks for another.
    """
    everything = list(instruments.values())
    n, few = len(everything), [sheet for sheet in everything if not (sheet.channels or sheet.blocks)]
    chosen = [
        itertools.combinations(few, 2 if pairs else 0),
        *(itertools.combinations(everything, k) for k in (0, 1, n - 1, n)),
    ]
    for aids in itertools.chain.from_iterable(chosen):
        for imu in (instruments.imu, None):
            yield Instruments(list(aids), imu, instruments.step)


@pytest.mark.parametrize("name", names())
def test_needs_are_what_a_row_refuses_to_work_without(name: str, recording: Recording):
    estimator = make(name)
    assert checked_needs(estimator.needs), "every row needs something"
    for instruments in subsets(recording.instruments, name in FIRST):
        if estimator.reference:
            estimator.reveal(dataclasses.replace(recording, instruments=instruments))
        there = [*instruments, *(["imu"] if instruments.imu is not None else [])]
        refused = ""
        try:
            estimator.reset(copy.deepcopy(recording.start), instruments)
        except UnsuitableScenario as error:
            refused = str(error)
        lack = lacking(estimator.needs, instruments)
        assert bool(lack) == bool(refused), f"with {there}: the needs say {lack!r}, and reset() says {refused!r}"
