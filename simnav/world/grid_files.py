"""Grids of depths from files: GeoTIFF (library ``tifffile``) and NetCDF (library ``netCDF4``).

A grid is regular in latitude and longitude (WGS 84), as those of GEBCO and EMODnet are. Its values are elevations,
positive up, or depths. `simnav.world.bathymetry` says which.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from simnav.spec import SpecError, closest
from simnav.types import Array

__all__ = ["GeographicGrid", "read_grid"]

#: How a library is installed.
_INSTALL = "pip install 'simnav[bathymetry]'"
#: Names of the variables of latitude and longitude in NetCDF files.
_LATITUDES, _LONGITUDES = ("lat", "latitude", "y"), ("lon", "longitude", "x")
#: How much the steps between neighbouring latitudes or longitudes may differ, as a share of them.
_REGULAR = 1e-3
#: GeoTIFF: models of coordinates, and whether a value is that of an area or of a point.
_GEOGRAPHIC, _POINT = 2, 2


@dataclass(frozen=True, eq=False)
class GeographicGrid:
    """Values at regular latitudes and longitudes.

    Attributes
    ----------
    latitude : (r,) array
        Ascending [rad].
    longitude : (c,) array
        Ascending [rad].
    value : (r, c) array
        As the file has them; NaN where it has none.
    """

    latitude: Array
    longitude: Array
    value: Array


def read_grid(path: Path, variable: str = "") -> GeographicGrid:
    """The grid of a file, which is read again only if it was changed.

    Parameters
    ----------
    path : Path
        A file with the ending ``.tif`` or ``.tiff`` (GeoTIFF), or ``.nc`` or ``.grd`` (NetCDF).
    variable : str
        Name of the variable of a NetCDF file; empty: the only one over latitude and longitude.

    Raises
    ------
    SpecError
        If the file cannot be read or is not valid, or the library is not installed.
    """
    try:
        state = path.stat()
    except OSError as error:
        raise SpecError(f"{path}: cannot be read: {error.strerror}") from None
    return _read(path, variable, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=4)
def _read(path: Path, variable: str, modified: int, size: int) -> GeographicGrid:
    """The grid of a file, by the time of its last change and its size."""
    ending = path.suffix.lower()
    if ending in (".tif", ".tiff"):
        if variable:
            raise SpecError(f"{path}: variable = {variable!r}: a GeoTIFF has no named variables; leave it out")
        latitude, longitude, value = _geotiff(path)
    elif ending in (".nc", ".grd"):
        latitude, longitude, value = _netcdf(path, variable)
    else:
        raise SpecError(f"{path}: should end in .tif or .tiff (GeoTIFF), or .nc or .grd (NetCDF)")
    if value.shape != (len(latitude), len(longitude)) or min(value.shape) < 2:
        raise SpecError(f"{path}: the grid has the shape {value.shape}; it should have two or more rows and columns")
    for name, degrees, most in (("latitudes", latitude, 90.0), ("longitudes", longitude, 360.0)):
        steps = np.diff(degrees)
        if not (np.isfinite(degrees).all() and (abs(degrees) <= most + 1e-6).all()):
            raise SpecError(f"{path}: its {name} should be in degrees, not {degrees[0]:g} to {degrees[-1]:g}")
        if steps[0] == 0.0 or (abs(steps / steps[0] - 1.0) > _REGULAR).any():
            raise SpecError(f"{path}: the steps between its {name} differ; a grid has equal ones")
    if latitude[0] > latitude[-1]:
        latitude, value = latitude[::-1], value[::-1]
    if longitude[0] > longitude[-1]:
        longitude, value = longitude[::-1], value[:, ::-1]
    return GeographicGrid(np.radians(latitude), np.radians(longitude), np.ascontiguousarray(value))


def _geotiff(path: Path) -> tuple[Array, Array, Array]:
    """Latitudes, longitudes [deg] and values of a GeoTIFF."""
    try:
        import tifffile
    except ImportError:
        raise SpecError(f"{path}: to read a GeoTIFF needs the library tifffile: {_INSTALL}") from None
    try:
        with tifffile.TiffFile(path) as file:
            page: Any = file.pages[0]
            tags: dict[str, Any] = page.geotiff_tags
            missing = page.tags.get(42113)
            value = np.asarray(page.asarray(), dtype=np.float64)
    except Exception as error:
        raise SpecError(f"{path}: cannot be read as a GeoTIFF: {_line(error)}") from None
    if not tags or "ModelPixelScale" not in tags or "ModelTiepoint" not in tags:
        raise SpecError(f"{path}: it has no geographic reference (tags ModelPixelScale and ModelTiepoint of a GeoTIFF)")
    if int(tags.get("GTModelTypeGeoKey", 0)) != _GEOGRAPHIC:
        raise SpecError(
            f"{path}: its coordinates are not latitude and longitude; gdalwarp -t_srs EPSG:4326 makes such a file"
        )
    if value.ndim != 2:
        raise SpecError(f"{path}: the image has the shape {value.shape}; a grid has one value at each place")
    if missing is not None:
        try:
            value[value == float(str(missing.value).strip("\0 "))] = np.nan
        except ValueError:
            raise SpecError(f"{path}: its value for missing data, {missing.value!r}, is no number") from None
    (wide, high), (column, row, _, east, north) = tags["ModelPixelScale"][:2], tags["ModelTiepoint"][:5]
    half = 0.0 if int(tags.get("GTRasterTypeGeoKey", 1)) == _POINT else 0.5
    longitude = east + wide * (np.arange(value.shape[1]) + half - column)
    latitude = north - high * (np.arange(value.shape[0]) + half - row)
    return latitude, longitude, value


def _netcdf(path: Path, variable: str) -> tuple[Array, Array, Array]:
    """Latitudes, longitudes [deg] and values of a NetCDF file."""
    try:
        import netCDF4
    except ImportError:
        raise SpecError(f"{path}: to read NetCDF needs the library netCDF4: {_INSTALL}") from None
    try:
        with netCDF4.Dataset(path) as file:
            names: dict[str, Any] = file.variables
            axes = [next((n for n in known if n in names), "") for known in (_LATITUDES, _LONGITUDES)]
            if not all(axes):
                raise SpecError(
                    f"{path}: it has no variables of latitude ({', '.join(_LATITUDES)}) and longitude "
                    f"({', '.join(_LONGITUDES)}), but {', '.join(names)}"
                )
            over = [n for n, v in names.items() if v.dimensions == tuple(axes)]
            name = variable or (over[0] if len(over) == 1 else "")
            if not name and over:
                raise SpecError(f"{path}: it has several grids; variable should name one of: {', '.join(over)}")
            if name not in over:
                given = f"variable = {variable!r} is no grid" if variable else "it has no grid"
                raise SpecError(f"{path}: {given} over latitude and longitude{closest(variable, over)}")
            latitude, longitude = (np.asarray(names[axis][:], dtype=np.float64) for axis in axes)
            value = np.ma.filled(np.ma.asarray(names[name][:], dtype=np.float64), np.nan)
    except SpecError:
        raise
    except Exception as error:
        raise SpecError(f"{path}: cannot be read as NetCDF: {_line(error)}") from None
    return latitude, longitude, np.asarray(value)


def _line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
