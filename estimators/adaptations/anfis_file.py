"""The parameter file of the ANFIS: the trained network, its data and the command that made it."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from simnav.types import Array

from .sugeno import Sugeno

__all__ = ["FEATURES", "FORMAT", "FeatureSet", "Parameters", "ParametersError", "shipped"]

FeatureSet = Literal["innovation", "motion", "recent"]
#: The inputs of each set, in order (`simnav.estimators.adaptations.anfis`).
FEATURES: dict[str, tuple[str, ...]] = {
    "innovation": ("innovation", "turn_rate", "change_of_speed"),
    "motion": ("speed", "turn_rate", "change_of_speed"),
    "recent": ("innovation", "recent_innovations", "turn_rate"),
}
#: Version of the format of the file. It is increased when the format changes.
FORMAT = 1


class ParametersError(ValueError):
    """A parameter file cannot be used. The message names the file and the field."""


@dataclass(frozen=True, eq=False)
class Parameters:
    """A trained network with the scale of its inputs.

    Attributes
    ----------
    features : str
        Name of the set of inputs, a key of `FEATURES`.
    low, high : (n,) array
        Range of each input in the training data. Inputs are clipped to it and scaled to [0, 1].
    typical : (n,) array
        Median of each input in the training data; it replaces an unknown input.
    largest : float
        Largest log variance factor in the training data; the output is limited to [0, largest].
    network : Sugeno
        The trained network with n inputs.
    record : dict
        Record of the training: command, seeds, errors, version of the simulator.
    """

    features: str
    low: Array
    high: Array
    typical: Array
    largest: float
    network: Sugeno
    record: dict[str, Any] = field(default_factory=dict)

    def scale(self, x: Array) -> Array:
        """Scale (k, n) inputs to [0, 1]; NaN is replaced by the typical value."""
        known = np.where(np.isnan(x), self.typical, x)
        scaled: Array = (np.clip(known, self.low, self.high) - self.low) / (self.high - self.low)
        return scaled

    def log_factor_of(self, row: list[float]) -> float:
        """Logarithm of the variance divided by the datasheet's, from one row of inputs."""
        scaled = [
            (min(max(typical if x != x else x, low), high) - low) / (high - low)
            for x, (low, high, typical) in zip(row, self._ranges)
        ]
        return min(max(self.network.single(scaled), 0.0), self.largest)

    @cached_property
    def _ranges(self) -> list[list[float]]:
        ranges: list[list[float]] = np.column_stack([self.low, self.high, self.typical]).tolist()
        return ranges

    def save(self, path: Path) -> None:
        """Write the file; OSError if it cannot be written."""
        network = self.network
        document = {
            "format": FORMAT,
            "method": "ANFIS: first-order Sugeno network, a reconstruction of Jiang et al. (2026), section 3",
            "features": self.features,
            "inputs": FEATURES[self.features],
            "low": _rounded(self.low),
            "high": _rounded(self.high),
            "typical": _rounded(self.typical),
            "largest": float(f"{self.largest:.9g}"),
            "centres": _rounded(network.centres),
            "widths": _rounded(network.widths),
            "consequents": _rounded(network.consequents),
            "training": self.record,
        }
        rows = [f" {json.dumps(k)}: {_laid_out(v)}" for k, v in document.items()]
        path.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> Parameters:
        """Read a file that `save` wrote.

        Raises
        ------
        ParametersError
            If the file does not exist, is not a parameter file, or a field is missing or wrong.
        """
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise ParametersError(
                f"{path}: {error.strerror}; 'simnav paper train-anfis' writes a parameter file"
            ) from None
        except ValueError as error:
            raise ParametersError(f"{path}: no parameter file of the ANFIS, for it is not JSON ({error})") from None
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            found = document.get("format") if isinstance(document, dict) else None
            raise ParametersError(f"{path}: format should be {FORMAT}, not {found!r}; train it again")
        features = document.get("features")
        if not isinstance(features, str) or features not in FEATURES:
            raise ParametersError(f"{path}: features should be one of {', '.join(FEATURES)}, not {features!r}")
        n = len(FEATURES[features])
        if document.get("inputs") != list(FEATURES[features]):
            raise ParametersError(f"{path}: inputs should be {list(FEATURES[features])}, not {document.get('inputs')}")
        centres = _array(path, document, "centres", (n, -1))
        m = centres.shape[1]
        parameters = cls(
            features,
            _array(path, document, "low", (n,)),
            _array(path, document, "high", (n,)),
            _array(path, document, "typical", (n,)),
            float(_array(path, document, "largest", ())),
            Sugeno(
                centres,
                _array(path, document, "widths", (n, m)),
                _array(path, document, "consequents", (m**n, n + 1)),
            ),
            document["training"] if isinstance(document.get("training"), dict) else {},
        )
        if not np.all(parameters.high > parameters.low):
            raise ParametersError(f"{path}: high should be above low for every input")
        if not np.all(parameters.network.widths > 0.0):
            raise ParametersError(f"{path}: widths should be positive")
        if parameters.largest < 0.0:
            raise ParametersError(f"{path}: largest should not be negative, and it is {parameters.largest:g}")
        return parameters


def shipped(features: str) -> Path:
    """The parameter file that comes with the package.

    Raises
    ------
    ValueError
        If there is no such set of features.
    """
    if features not in FEATURES:
        raise ValueError(f"features = {features!r}: it must be one of {', '.join(FEATURES)}")
    return Path(__file__).with_name(f"anfis_{features}.json")


def _array(path: Path, document: dict[str, Any], name: str, shape: tuple[int, ...]) -> Array:
    """A field as finite numbers of a shape, in which -1 stands for any length but 0."""
    if name not in document:
        raise ParametersError(f"{path}: the field {name} is missing")
    try:
        value = np.array(document[name], dtype=np.float64)
    except (ValueError, TypeError):
        value = np.array(np.nan)
    fits = value.ndim == len(shape) and all(v == s or (s == -1 and v > 0) for v, s in zip(value.shape, shape))
    if not fits or not np.isfinite(value).all():
        size = " x ".join("any" if s == -1 else str(s) for s in shape) or "a single"
        raise ParametersError(f"{path}: {name} should be {size} finite number{'s' if shape else ''}")
    return value


def _rounded(value: Array) -> Any:
    """Numbers of nine digits, as lists."""
    return np.vectorize(lambda x: float(f"{x:.9g}"), otypes=[float])(value).tolist()


def _laid_out(value: Any) -> str:
    """JSON, with the rows of a matrix and the entries of a table on lines of their own."""
    if isinstance(value, dict):
        return "{\n" + ",\n".join(f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in value.items()) + "\n }"
    if isinstance(value, list) and value and isinstance(value[0], list):
        return "[\n" + ",\n".join(f"  {json.dumps(row)}" for row in value) + "\n ]"
    return json.dumps(value)
