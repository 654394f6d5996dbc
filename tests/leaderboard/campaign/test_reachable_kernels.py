"""A server loads the kernels that an estimator calls, and not many more."""

from __future__ import annotations

from typing import Any

import pytest

from simnav.compiled import Kernel, kernels
from simnav.estimator import find, make
from simnav.leaderboard.campaign.confinement.reachable_kernels import reachable_kernels
from simnav.recording import Recording
from simnav.testing.altered_recordings import until
from simnav.testing.contract_check import contract_recording
from simnav.trial import run_trial
from tests.cases.sorts_of_rows import first_of_each_solver


@pytest.fixture(scope="module")
def beginning() -> Recording:
    """Twelve seconds with an instrument of every kind."""
    return until(contract_recording(0), 12.0)


@pytest.mark.parametrize("name", [n for n in first_of_each_solver() if not find(n).reference])
def test_what_a_row_calls_is_loaded(name: str, beginning: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    called: set[Kernel[..., Any]] = set()
    plain, unchecked, compiled = Kernel.__call__, Kernel.unchecked.fget, Kernel.compile
    assert unchecked is not None

    def watched(self: Kernel[..., Any], *args: Any) -> Any:
        if self.typed:
            called.add(self)
        return plain(self, *args)

    def entered(self: Kernel[..., Any]) -> Any:
        called.add(self)
        return unchecked(self)

    def handed_over(self: Kernel[..., Any]) -> Any:
        if self.passed:
            called.add(self)
        return compiled(self)

    monkeypatch.setattr(Kernel, "compile", handed_over)
    monkeypatch.setattr(Kernel, "__call__", watched)
    monkeypatch.setattr(Kernel, "unchecked", property(entered))
    estimator = make(name)
    trial = run_trial(estimator, beginning)
    monkeypatch.undo()
    assert trial.status == "ok", trial.reason
    loaded = reachable_kernels([find(name).__module__])
    assert {repr(k) for k in called} <= {repr(k) for k in loaded}


def test_of_all_kernels_a_filter_needs_a_part() -> None:
    some = reachable_kernels(["simnav.estimators.rows.kalman"])
    assert 10 < len(some) < 0.6 * len(kernels())
    models = {f"simnav.estimators.models.{model}_functions" for model in ("inertial", "ship")}
    assert models <= {k.__module__ for k in some}  # they are named by a tuple of functions only
    of_the_world = {k.__module__ for k in some if k.__module__.startswith("simnav.world")}
    assert of_the_world == {"simnav.world.depth_grid"}  # a chart is in the datasheet, the rest is the simulator's


def test_what_has_no_kernels_needs_none() -> None:
    assert reachable_kernels([]) == reachable_kernels(["simnav.geometry.earth"]) == []


@pytest.mark.parametrize("name", ["simnav", "simnav.make", "simnav.nothing.here"])
def test_who_may_call_anything_gets_all(name: str) -> None:
    assert reachable_kernels([name]) == kernels()
