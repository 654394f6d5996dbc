"""The loaders of data sets: every window of every voyage once, mixed, and shared among the workers of PyTorch."""

from __future__ import annotations

import importlib.util
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import simnav
from simnav.environment.seeds import FIRST_TRAINING_SEED

EXAMPLES = Path(__file__).parents[2] / "examples"
FIRST = 2 * FIRST_TRAINING_SEED


def example(name: str):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    made = tmp_path_factory.mktemp("data") / "set"
    simnav.dataset("training-gnss-faults", made, size=3, splits="train", workers=1)
    return made


def seen(batches) -> list[tuple[int, float]]:
    """Seed and begin of each window, as they come."""
    return [pair for b in batches for pair in zip(b["seed"].tolist(), b["interval"][:, 0].tolist(), strict=True)]


def test_the_numpy_loader_mixes_the_windows_of_an_epoch(folder):
    module = example("numpy_loader")
    expected = Counter((FIRST + number, 60.0 * k) for number in range(3) for k in range(4))
    options = {"length": 60.0, "batch": 5}
    first = seen(module.loader(range(3), folder, **options))
    assert Counter(first) == expected
    assert first == seen(module.loader(range(3), folder, **options))
    assert first == seen(module.loader(range(3), **options))  # simulated
    assert first != seen(module.loader(range(3), folder, seed=1, **options))
    assert first != sorted(first)


def test_a_window_stays_whole_when_it_is_mixed(folder):
    recordings = {r.seed: r for r in simnav.read_voyages(folder)}
    for batch in example("numpy_loader").loader(range(3), folder, length=60.0, batch=5):
        for i, seed in enumerate(batch["seed"].tolist()):
            truth = recordings[seed].data.truth
            end = np.searchsorted(truth.time, batch["interval"][i, 1] - 1e-6)
            np.testing.assert_array_equal(batch["truth"][i, -1, 0], truth.position[end])


@pytest.mark.parametrize("workers", [0, 2])
def test_the_workers_of_pytorch_share_the_voyages(folder, workers):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    data = example("torch_dataset").Voyages("training-gnss-faults", length=60.0, folder=folder, size=3)
    # Workers of this test are forks; the example is no module that others could import.
    loader = torch.utils.data.DataLoader(
        data, batch_size=4, num_workers=workers, multiprocessing_context="fork" if workers else None
    )
    batches = list(loader)
    assert Counter(seen(batches)) == Counter((FIRST + number, 60.0 * k) for number in range(3) for k in range(4))
    assert batches[0]["imu"]["specific_force"].dtype == torch.float32
    assert batches[0]["truth"].dtype == torch.float64
