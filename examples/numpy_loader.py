"""Batches of windows for NumPy: from the files of a data set, or simulated as they are needed.

The voyages come in a new order in each epoch, and the windows of some voyages are mixed. Run it::

    simnav dataset training-gnss-faults --size 200 --output voyages
    python examples/numpy_loader.py --folder voyages
"""

from __future__ import annotations

import argparse
import time
from itertools import islice

import numpy as np

import simnav

FAMILY = "training-gnss-faults"


def mixed(batches, rng, held=8):
    """The windows of some batches at a time, in random order, in batches of the same size."""
    while group := list(islice(batches, held)):
        joined = joined_of(group)
        order = np.array_split(rng.permutation(len(joined["seed"])), len(group))
        yield from (rows_of(joined, rows) for rows in order)


def joined_of(parts):
    """Several batches as one."""
    return {
        name: joined_of([p[name] for p in parts]) if isinstance(a, dict) else np.concatenate([p[name] for p in parts])
        for name, a in parts[0].items()
    }


def rows_of(batch, rows):
    """Some windows of a batch."""
    return {name: rows_of(a, rows) if isinstance(a, dict) else a[rows] for name, a in batch.items()}


def loader(numbers, folder=None, split="train", length=10.0, batch=64, seed=0):
    """Batches of one epoch: windows of ``length`` seconds of the voyages with these numbers.

    Without a folder, the voyages are simulated. The seed decides the order; each epoch should have another one.
    """
    rng = np.random.default_rng(seed)
    order = rng.permutation(np.asarray(numbers)).tolist()
    if folder is None:
        recordings = simnav.voyages(FAMILY, split, order)
    else:
        recordings = simnav.read_voyages(folder, split, order)
    return mixed(simnav.windows(recordings, FAMILY, length, batch=batch), rng)


def main():
    """Go through the voyages once, and tell how quick it is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", help="data set; without it the voyages are simulated")
    parser.add_argument("--size", type=int, default=200, help="voyages of an epoch")
    options = parser.parse_args()
    begin, windows, faulty = time.perf_counter(), 0, 0
    for batch in loader(range(options.size), options.folder):
        windows += len(batch["seed"])
        faulty += int((batch["gnss"]["faults"] != 0).any(axis=1).sum())
    print(
        f"{windows} windows, {faulty} of them with a faulty fix; {windows / (time.perf_counter() - begin):.0f} a second"
    )


if __name__ == "__main__":
    main()
