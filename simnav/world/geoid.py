"""Undulations of the geoid from a grid that PROJ reads (library ``pyproj``), such as EGM96 and EGM2008.

simnav has no grid of its own. PROJ's own tool gets one (``pyproj sync --file us_nga_egm96_15``), the package
``proj-data`` of Debian has one (``/usr/share/proj/egm96_15.gtx``), and surveyors have others for their waters. The
formats are those of PROJ: GTX and GeoTIFF.

Source: F. G. Lemoine et al., *The Development of the Joint NASA GSFC and NIMA Geopotential Model EGM96*,
NASA/TP-1998-206861; PROJ interpolates linearly between the nodes, for EGM96 on 15' with an error of some centimetres.
"""

from __future__ import annotations

import os
from functools import lru_cache
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from simnav.spec import SpecError
from simnav.types import Array

__all__ = ["Geoid", "read_geoid"]


def read_geoid(name: str) -> Geoid:
    """The geoid of a grid, which is read again only if the file was changed.

    Parameters
    ----------
    name : str
        Path of the grid. The last part of it may also be the name of a grid in a folder of PROJ.

    Raises
    ------
    SpecError
        If there is no such grid, PROJ cannot read it, or the library is not installed.
    """
    path = _found(Path(name))
    return _read(path, path.stat().st_mtime_ns)


class Geoid:
    """Heights of the geoid above the ellipsoid WGS 84.

    Parameters
    ----------
    path : Path
        The grid.

    Attributes
    ----------
    path : Path
        The grid.
    """

    def __init__(self, path: Path):
        pyproj = _library(path)
        self.path = path
        try:
            self._shift = pyproj.Transformer.from_pipeline(f'+proj=vgridshift +grids="{path}" +multiplier=1')
        except pyproj.exceptions.ProjError:
            raise SpecError(f"{path}: PROJ cannot read it as a grid of vertical shifts (GTX or GeoTIFF)") from None

    def undulation(self, position: Array) -> Array:
        """The (n,) undulations [m] at n positions (latitude, longitude [rad], altitude).

        Raises
        ------
        SpecError
            If the grid has no value at one of them.
        """
        latitude, longitude = np.asarray(position)[:, 0], np.asarray(position)[:, 1]
        height = np.asarray(self._shift.transform(longitude, latitude, np.zeros(len(latitude)), radians=True)[2])
        out = ~np.isfinite(height)
        if out.any():
            k = int(np.argmax(out))
            raise SpecError(
                f"{self.path}: the grid has no value at {degrees(latitude[k]):.4f} N, {degrees(longitude[k]):.4f} E"
            )
        return height


def _found(path: Path) -> Path:
    """The file of a grid: as it is named, or in a folder of PROJ."""
    if path.is_file():
        return path
    pyproj = _library(path)
    folders = [*pyproj.datadir.get_data_dir().split(os.pathsep), pyproj.datadir.get_user_data_dir()]
    for folder in folders:
        if (Path(folder) / path.name).is_file():
            return Path(folder) / path.name
    raise SpecError(
        f"geoid_grid = {str(path)!r}: there is no such file, and no {path.name} in the folders of PROJ "
        f"({', '.join(folders)}); 'pyproj sync --file us_nga_egm96_15' gets a grid"
    )


def _library(path: Path) -> Any:
    try:
        import pyproj
    except ImportError:
        raise SpecError(f"{path}: grids of a geoid need the library pyproj: pip install 'simnav[geoid]'") from None
    return pyproj


@lru_cache(maxsize=4)
def _read(path: Path, modified: int) -> Geoid:
    """The geoid of a file, by the time of its last change."""
    return Geoid(path)
