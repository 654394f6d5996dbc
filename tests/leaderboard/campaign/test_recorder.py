"""Recordings of a campaign: the same bits as here, and no harm where one hangs, raises or wants memory."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import simnav.source
from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.recorder import NoRecordingError, record_within
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.results import store
from simnav.scenario import Scenario, load
from simnav.types import Instruments

pytestmark = pytest.mark.skipif(os.name != "posix", reason="there are no forks")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load("harbour-multipath").model_copy(update={"duration": 30.0})


def same(a: Any, b: Any) -> bool:
    """Whether two values are equal to the bit, whatever is in them."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, Instruments):
        return isinstance(b, Instruments) and same(vars(a), vars(b))
    if isinstance(a, Mapping):
        return type(a) is type(b) and list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and (a == b or repr(a) == repr(b))


def test_the_bits_are_the_same(scenario: Scenario) -> None:
    made, here = record_within(scenario, 3, 60.0), simnav.source.record(scenario, 3)
    assert same(made, here)
    assert made.data.truth.position.flags.writeable
    assert not same(made, simnav.source.record(scenario, 4))


def hang(scenario: Scenario, seed: int) -> Any:
    time.sleep(60.0)


def gobble(scenario: Scenario, seed: int) -> Any:
    return np.ones(1 << 45)


def leave(scenario: Scenario, seed: int) -> Any:
    os._exit(3)


def refuse(scenario: Scenario, seed: int) -> Any:
    raise FileNotFoundError("the log\nis not there")


@pytest.mark.parametrize(
    ("record", "why"),
    [
        (hang, r"stopped after 0\.2 s"),
        (gobble, r"more than \d+ MiB of memory was wanted"),
        (leave, r"the process died \(exit code 3\)"),
        (refuse, "the log is not there"),
    ],
)
def test_what_goes_wrong_is_told(record: Any, why: str, scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simnav.source, "record", record)
    with pytest.raises(NoRecordingError, match=why):
        record_within(scenario, 0, 0.2 if record is hang else 60.0)


def test_a_campaign_goes_on_without_a_recording(
    scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every row has a result that says why, and the next run is made."""
    record = simnav.source.record
    monkeypatch.setattr(simnav.source, "record", lambda s, seed: leave(s, seed) if seed == 0 else record(s, seed))
    rows = [EstimatorRequest("gnss-only"), EstimatorRequest("oracle")]
    run_campaign([scenario], rows, range(2), tmp_path / "out", workers=1, confinement="none")
    found = [(r.estimator, r.seed, r.status) for r in store.load(tmp_path / "out")]
    assert found == [("gnss-only", 0, "no-recording"), ("gnss-only", 1, "ok"), ("oracle", 0, "no-recording"),
                     ("oracle", 1, "ok")]  # fmt: skip
    monkeypatch.undo()
    again = run_campaign([scenario], rows, range(2), tmp_path / "out", workers=1, confinement="none")
    assert (again.computed, again.failed) == (2, 0)
