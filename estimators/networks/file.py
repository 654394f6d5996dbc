"""The file of a trained network: plain arrays, and a record of what it is and how it was trained.

The file is an ``.npz`` without pickle. ``meta`` is JSON: ``format``, ``recipe``, ``version`` of the recipe's inputs,
``kinds`` of instruments that the network knows, and ``trained_on``: families, number of voyages, seeds of the voyages
and of the training, versions of libraries, time per epoch, errors. All other arrays are the network.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from simnav.types import Array

__all__ = ["BUDGETS", "FORMAT", "Network", "NetworkError", "NetworkPiece", "Shapes", "shipped"]

#: Version of the format; raised when it changes.
FORMAT = 1
#: A network that comes with simnav learned from so many voyages at most; there is one for each budget.
BUDGETS = (1000, 20_000)


#: From the arrays of a file to the shapes that they should have.
Shapes = Callable[[Mapping[str, Array]], Mapping[str, tuple[int, ...]]]


class NetworkError(ValueError):
    """A file is no network, or the network does not fit. The message is one sentence that names the file."""


@dataclass(frozen=True, eq=False)
class Network:
    """A trained network.

    Attributes
    ----------
    recipe : str
        Name of the recipe that made it.
    version : int
        Version of the inputs of this recipe.
    arrays : mapping of str to array
        The parameters.
    kinds : tuple of str
        Kinds of instruments that it learned from.
    trained_on : mapping
        Record of the training. ``streams`` are the first and last numbers of the voyages' random streams
        (`simnav.estimator.Estimator.learned_from`).
    """

    recipe: str
    version: int
    arrays: Mapping[str, Array]
    kinds: tuple[str, ...] = ()
    trained_on: Mapping[str, Any] = field(default_factory=dict)

    @property
    def parameters(self) -> int:
        """The number of parameters."""
        return sum(int(array.size) for array in self.arrays.values())

    @property
    def record(self) -> dict[str, Any]:
        """The record of the training, with the number of parameters, for a board."""
        return {**self.trained_on, "parameters": self.parameters}

    def save(self, path: str | Path) -> None:
        """Write the file; OSError if it cannot be written."""
        meta = {
            "format": FORMAT, "recipe": self.recipe, "version": self.version, "kinds": list(self.kinds),
            "trained_on": dict(self.trained_on),
        }  # fmt: skip
        arrays = {name: np.asarray(array, dtype=np.float32) for name, array in self.arrays.items()}
        with open(path, "wb") as file:
            np.savez_compressed(file, allow_pickle=False, meta=np.array(json.dumps(meta)), **arrays)

    @classmethod
    def load(cls, path: str | Path, recipe: str, version: int, shapes: Shapes) -> Network:
        """Read a file.

        Parameters
        ----------
        path : path
            The file.
        recipe, version : str, int
            What it must be of.
        shapes : callable
            From the arrays to the shapes that they should have.

        Raises
        ------
        NetworkError
            If it does not exist, is no network, or is one of another recipe, version or shape.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: np.asarray(file[name]) for name in file.files}
            meta = json.loads(str(arrays.pop("meta")))
            found = {name: meta[name] for name in ("format", "recipe", "version")}
            kinds, record = tuple(meta["kinds"]), dict(meta["trained_on"])
        except OSError as error:
            raise NetworkError(f"{path}: {error.strerror or error}") from None
        except (KeyError, TypeError, ValueError, zipfile.BadZipFile):
            raise NetworkError(f"{path}: it is no network file: an .npz with 'meta' and arrays is expected") from None
        for name, wanted in {"format": FORMAT, "recipe": recipe, "version": version}.items():
            if found[name] != wanted:
                raise NetworkError(f"{path}: {name} should be {wanted!r}, not {found[name]!r}")
        expected = shapes(arrays)
        for name, shape in expected.items():
            array = arrays.get(name)
            if array is None or array.shape != shape:
                has = "missing" if array is None else f"of shape {array.shape}"
                raise NetworkError(f"{path}: {name} is {has}; it should be of shape {shape}")
            if array.dtype.kind != "f" or not np.isfinite(array).all():
                raise NetworkError(f"{path}: {name} should hold finite numbers")
        own = {name: np.asarray(arrays[name], dtype=np.float64) for name in expected}
        return cls(recipe, version, own, kinds, record)


class NetworkPiece:
    """A piece of a row with a network.

    Attributes
    ----------
    network : Network
        The network.
    """

    network: Network

    @property
    def trained_on(self) -> dict[str, Any]:
        """The record of the training."""
        return self.network.record

    @staticmethod
    def chosen(file: str, budget: int, recipe: str, version: int, shapes: Shapes) -> Network:
        """The network of a file, or without one that of a budget that comes with simnav.

        Raises
        ------
        NetworkError
            As `Network.load`.
        ValueError
            As `shipped`.
        """
        path = Path(file).expanduser() if file else shipped(recipe, budget)
        return Network.load(path, recipe, version, shapes)


def shipped(recipe: str, budget: int) -> Path:
    """The file of a network that comes with simnav; ValueError if there is none of this budget.

    >>> shipped("noise-network", 1000).name
    'noise_network_1000.npz'
    """
    if budget not in BUDGETS:
        raise ValueError(f"budget = {budget}: networks come with the budgets {' and '.join(map(str, BUDGETS))}")
    return Path(__file__).with_name(f"{recipe.replace('-', '_')}_{budget}.npz")
