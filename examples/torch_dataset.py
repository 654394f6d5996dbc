"""Windows of voyages for PyTorch: an `IterableDataset`, simulated as they are needed or read from a data set.

Each worker of a `DataLoader` has voyages of its own. Run it::

    pip install torch
    python examples/torch_dataset.py --workers 2
"""

from __future__ import annotations

import argparse
import time
from itertools import count, islice

import torch
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

import simnav


class Voyages(IterableDataset):
    """Windows of the voyages of a split, without end, or of a data set.

    Parameters
    ----------
    family : str
        A training family.
    split : str
        ``train``, ``validation`` or ``test``.
    length : float
        Length of a window [s].
    folder : path, optional
        A data set, which is read once. Default: the voyages are simulated, one after the other.
    size : int, optional
        Number of voyages; needed with a folder. Default: without end.
    """

    def __init__(self, family, split="train", length=10.0, folder=None, size=None):
        super().__init__()
        self.family, self.split, self.length, self.folder, self.size = family, split, length, folder, size

    def __iter__(self):
        """Each window as a dictionary of tensors."""
        worker = get_worker_info()
        first, step = (0, 1) if worker is None else (worker.id, worker.num_workers)
        numbers = count(first, step) if self.size is None else range(first, self.size, step)
        if self.folder is None:
            recordings = simnav.voyages(self.family, self.split, numbers)
        else:
            recordings = simnav.read_voyages(self.folder, self.split, numbers)
        for one in simnav.windows(recordings, self.family, self.length, batch=1):
            yield tensors(one)


def tensors(window):
    """The arrays of one window as tensors: in single precision, but for times and the truth."""
    found = {}
    for name, value in window.items():
        if isinstance(value, dict):
            found[name] = tensors(value)
        else:
            tensor = torch.from_numpy(value.astype("int64") if value.dtype.kind in "iu" else value)[0]
            exact = name in ("interval", "time", "truth") or not tensor.is_floating_point()
            found[name] = tensor if exact else tensor.float()
    return found


def main():
    """Load some batches, and tell how quick it is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", help="data set; without it the voyages are simulated")
    parser.add_argument("--family", default="training-gnss-faults")
    parser.add_argument("--size", type=int, default=200, help="voyages")
    parser.add_argument("--workers", type=int, default=2, help="processes that prepare windows")
    options = parser.parse_args()
    data = Voyages(options.family, folder=options.folder, size=options.size)
    begin, windows = time.perf_counter(), 0
    for batch in islice(DataLoader(data, batch_size=64, num_workers=options.workers), 50):
        windows += len(batch["seed"])
    print({name: tuple(t.shape) for name, t in batch["gnss"].items()})
    print(f"{windows / (time.perf_counter() - begin):.0f} windows a second")


if __name__ == "__main__":
    main()
