"""How a campaign grows: exponents, and the model of a cluster, on figures that are known."""

from __future__ import annotations

import pytest

from tests.benchmarks.scaling import FILE, NODES, SIZES, exponent, model, read

FIGURES = {"workers": {"worker": {1.0: 2.0}, "scheduler": {1.0: 0.01}, "campaign": {1.0: 0.05}}}


def test_the_exponent_is_that_of_the_time_without_the_start():
    assert exponent({size: 3.0 + 0.5 * size**1.5 for size in (1.0, 2.0, 4.0)}, start=3.0) == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("workers", "rate", "limit"), [(1, 0.5, "the workers"), (30, 15.0, "the workers"), (100, 20.0, "the results")]
)
def test_workers_are_the_limit_until_one_process_is(workers: int, rate: float, limit: str):
    found, what = model(FIGURES, workers)
    assert found == pytest.approx(rate)
    assert what.startswith(limit)


def test_the_figures_of_one_worker_are_kept():
    kept = read(FILE)
    assert len(kept["rows"]["campaign"]) == len(SIZES)
    assert list(kept["nodes"]["epoch"]) == list(NODES)
