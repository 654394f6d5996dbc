"""Obstacles from a GeoJSON file, such as the buildings of a harbour from a map service.

Read are polygons and multipolygons of a FeatureCollection, of one Feature, or alone (RFC 7946: longitude before
latitude, in degrees, WGS 84). The properties of a feature say how high it is: ``top_m`` or ``height``, and from where
on, ``bottom_m`` or ``min_height`` (otherwise 0), above the ellipsoid, in metres. The two other names are those of
OpenStreetMap, where a number may be followed by ``m``. A hole in a polygon, such as a courtyard, is filled.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from simnav.spec import SpecError
from simnav.types import Array

__all__ = ["Building", "read_buildings"]

#: The largest file that is read [bytes].
MOST_BYTES = 50_000_000
_METRES = re.compile(r"\s*([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(?:m|metres|meters)?\s*")


@dataclass(frozen=True)
class Building:
    """One polygon of a file.

    Attributes
    ----------
    name : str
        Its property ``name``, or which feature of the file it is.
    corners : (n, 2) array
        Latitude and longitude [rad]; the first corner is not repeated at the end.
    bottom, top : float
        Heights above the ellipsoid [m].
    """

    name: str
    corners: Array
    bottom: float
    top: float


def read_buildings(path: Path) -> list[Building]:
    """All polygons of a file, which is read again only if it was changed.

    Raises
    ------
    SpecError
        If the file cannot be read or is not valid: one sentence with the file and the number of the feature.
    """
    try:
        state = path.stat()
    except OSError as error:
        raise SpecError(f"{path}: cannot be read: {error.strerror}") from None
    if state.st_size > MOST_BYTES:
        raise SpecError(
            f"{path}: {state.st_size / 1e6:.0f} MB are too much for a map of obstacles; {MOST_BYTES / 1e6:.0f} go"
        )
    return list(_read(path, state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=8)
def _read(path: Path, modified: int, size: int) -> tuple[Building, ...]:
    """The polygons of a file, by the time of its last change and its size."""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SpecError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise SpecError(f"{path}: not valid GeoJSON: {error}") from None
    found = [building for k, feature in enumerate(_features(table, path), 1) for building in _of(feature, k, path)]
    if not found:
        raise SpecError(f"{path}: there is no polygon; obstacles are features with a Polygon or a MultiPolygon")
    return tuple(found)


def _features(table: Any, path: Path) -> list[Any]:
    kind = table.get("type") if isinstance(table, dict) else None
    if kind == "FeatureCollection" and isinstance(table.get("features"), list):
        return list(table["features"])
    if kind == "Feature":
        return [table]
    if kind in ("Polygon", "MultiPolygon"):
        return [{"type": "Feature", "geometry": table}]
    raise SpecError(f"{path}: type = {kind!r:.60} should be 'FeatureCollection' with a list of features, or 'Feature'")


def _of(feature: Any, number: int, path: Path) -> Iterator[Building]:
    """The polygons of a feature; those of other geometries, such as lines, are left out."""
    where = f"{path}, feature {number}"
    geometry = feature.get("geometry") if isinstance(feature, dict) else None
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(geometry, dict) or kind not in ("Polygon", "MultiPolygon"):
        return
    given = feature.get("properties") or {}
    properties = given if isinstance(given, dict) else {}
    top = _height(properties, ("top_m", "height"), where)
    if top is None:
        raise SpecError(f"{where}: there is no height; the properties should have 'top_m' or 'height' in metres")
    bottom = _height(properties, ("bottom_m", "min_height"), where) or 0.0
    polygons = geometry.get("coordinates")
    name = str(properties.get("name") or f"feature {number}")
    for polygon in [polygons] if kind == "Polygon" else polygons if isinstance(polygons, list) else []:
        yield Building(name, _corners(polygon, where), bottom, top)


def _height(properties: dict[str, Any], names: tuple[str, str], where: str) -> float | None:
    for name in names:
        value = properties.get(name)
        if value is None:
            continue
        match = _METRES.fullmatch(value) if isinstance(value, str) else None
        number = float(match[1]) if match else value
        if not isinstance(number, (int, float)) or isinstance(number, bool) or not math.isfinite(number):
            raise SpecError(f"{where}: {name} = {value!r:.60} should be a number of metres")
        return float(number)
    return None


def _corners(polygon: Any, where: str) -> Array:
    """Latitudes and longitudes of the outer ring [rad]."""
    try:
        ring = np.array([[float(point[1]), float(point[0])] for point in polygon[0]])
    except (TypeError, ValueError, IndexError, KeyError, OverflowError):
        raise SpecError(f"{where}: its coordinates should be rings of [longitude, latitude] in degrees") from None
    if len(ring) > 1 and np.array_equal(ring[0], ring[-1]):
        ring = ring[:-1]
    if len(ring) < 3:
        raise SpecError(f"{where}: a polygon has three corners or more, not {len(ring)}")
    wrong = ~(np.abs(ring) <= [90.0, 180.0]).all(axis=1)
    if wrong.any():
        latitude, longitude = ring[int(np.argmax(wrong))]
        raise SpecError(
            f"{where}: [{longitude:g}, {latitude:g}] is no place; coordinates should be longitude and latitude in "
            "degrees, in this order"
        )
    return np.asarray(np.radians(ring))
