"""Grids of depths: relief beside its covariance, interpolation, rays, files, the chart's error, and bad input."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import tifffile
from scipy.special import gamma, kv

from simnav.geometry.earth import displace
from simnav.scenario import Scenario
from simnav.spec import SpecError
from simnav.world import Bathymetry
from simnav.world.depth_grid import DepthGrid, grid_of
from simnav.world.relief import relief
from simnav.world.surroundings import SurroundingsError, surround

PLACE: dict[str, Any] = {"latitude_deg": 54.0, "longitude_deg": 7.9}
MIDDLE = np.array([np.radians(54.0), np.radians(7.9), 0.0])


def von_karman(distance: float, scale: float, hurst: float) -> float:
    """Covariance of a relief of unit variance (Goff and Jordan 1988)."""
    x = distance / scale
    return float(2.0 ** (1.0 - hurst) / gamma(hurst) * x**hurst * kv(hurst, x))


@pytest.mark.parametrize("hurst", [0.5, 0.85])
def test_the_relief_has_the_covariance_of_von_karman(hurst: float) -> None:
    scale, spacing = 80.0, (10.0, 20.0)
    fields = [relief((600, 300), spacing, 2.0, scale, hurst, np.random.default_rng(k)) for k in range(3)]
    for lag in (40.0, 80.0, 160.0):
        expected = 4.0 * von_karman(lag, scale, hurst)
        i, j = round(lag / spacing[0]), round(lag / spacing[1])
        north = np.mean([f[i:] * f[:-i] for f in fields])
        east = np.mean([f[:, j:] * f[:, :-j] for f in fields])
        np.testing.assert_allclose([north, east], expected, atol=0.12)
    if hurst == 0.5:
        assert von_karman(40.0, scale, hurst) == pytest.approx(np.exp(-0.5))


def test_interpolation_is_exact_for_a_parabola_and_its_gradient() -> None:
    """Keys's cubic convolution has an error of third order."""
    north, east = np.meshgrid(10.0 * np.arange(-6, 7), 20.0 * np.arange(-5, 6), indexing="ij")

    def bottom(n: Any, e: Any) -> Any:
        return 60.0 + 0.1 * n - 0.2 * e + 1e-3 * n * n + 2e-3 * e * n - 1e-3 * e * e

    grid = DepthGrid(MIDDLE, np.array([10.0, 20.0]), bottom(north, east))
    place = np.random.default_rng(1).uniform(-45.0, 45.0, (50, 2))
    n, e = place.T
    depth, gradient = grid.at(place)
    np.testing.assert_allclose(depth, bottom(n, e), atol=1e-9)
    slopes = np.stack([0.1 + 2e-3 * n + 2e-3 * e, -0.2 + 2e-3 * n - 2e-3 * e], axis=1)
    np.testing.assert_allclose(gradient, slopes, atol=1e-9)
    beyond, flat = grid.at(np.array([[500.0, 0.0]]))
    assert (beyond[0], flat[0, 0]) == (pytest.approx(bottom(60.0, 0.0)), 0.0)


def test_a_ray_meets_a_slope_where_geometry_says() -> None:
    north = 10.0 * np.arange(-30, 31)
    grid = DepthGrid(MIDDLE, np.array([10.0, 10.0]), np.repeat(100.0 + 0.3 * north[:, None], 61, axis=1))
    angle = np.radians([-50.0, 0.0, 40.0])
    ray = np.stack([np.sin(angle), np.zeros(3), np.cos(angle)], axis=1)
    distance, gradient, met = grid.distance(np.zeros((3, 2)), np.full(3, 60.0), ray)
    np.testing.assert_allclose(distance, 40.0 / (np.cos(angle) - 0.3 * np.sin(angle)), rtol=1e-6)
    np.testing.assert_allclose(gradient, [[0.3, 0.0]] * 3, atol=1e-9)
    assert met.all()
    assert not grid.distance(np.zeros((1, 2)), np.full(1, 98.0), np.array([[0.95, 0.0, 0.312]]))[2].any()


def test_the_bottom_is_that_of_a_place_and_the_error_of_its_chart_that_of_a_run() -> None:
    spec = Bathymetry.from_toml(PLACE | {"extent_m": [1000, 2000], "slope_percent": 2.0, "chart_error_m": 0.5})
    chart = grid_of(spec.chart())
    assert chart.depth.shape == (101, 201)
    assert grid_of(spec.chart()) is chart
    assert chart.depth[-20:].mean() - chart.depth[:20].mean() == pytest.approx(16.2, abs=6.0)
    errors = [spec.build("bathymetry", seed).grid.depth - chart.depth for seed in (1, 2, 1)]
    assert errors[0].std() == pytest.approx(0.5, rel=0.1)
    assert abs(np.corrcoef(errors[0].ravel(), errors[1].ravel())[0, 1]) < 0.2
    np.testing.assert_array_equal(errors[0], errors[2])
    other = Bathymetry.from_toml(PLACE | {"extent_m": [1000, 2000], "seed": 2}).grid()
    assert abs(np.corrcoef(other.depth.ravel(), chart.depth.ravel())[0, 1]) < 0.3


def test_it_is_the_bottom_of_the_surroundings() -> None:
    spec = Bathymetry.from_toml(PLACE)
    found = surround(None, None, None, {"bathymetry": spec}, start=None, seed=1)
    place = displace(MIDDLE, np.array([[100.0, -300.0, 0.0]]))
    node = spec.grid().depth[200 + 10, 200 - 30]
    assert found["bottom"].depth(place, np.zeros(1))[0] == pytest.approx(node, abs=0.02)
    assert found["bottom"] is found["bathymetry"]
    with pytest.raises(SurroundingsError, match=r"54\.0\d+ N, .* is outside of the grid of depths, which spans 53\.98"):
        found["bottom"].depth(displace(MIDDLE, np.array([[2100.0, 0.0, 0.0]])), np.zeros(1))


def geotiff(
    path: Path, values: Any, west: float = 7.8, north: float = 54.1, step: float = 0.01, model: int = 2
) -> Path:
    """A GeoTIFF of elevations whose pixels are areas."""
    keys = (1, 1, 0, 2, 1024, 0, 1, model, 1025, 0, 1, 1)
    tags = [
        (33550, "d", 3, (step, step, 0.0), True), (33922, "d", 6, (0.0, 0.0, 0.0, west, north, 0.0), True),
        (34735, "H", len(keys), keys, True), (42113, "s", 0, "-9999", True),
    ]  # fmt: skip
    tifffile.imwrite(path, np.asarray(values, dtype=np.float32), extratags=tags)
    return path


def netcdf(path: Path, latitude: Any, longitude: Any, values: Any) -> Path:
    """A NetCDF file of elevations."""
    with netCDF4.Dataset(path, "w") as file:
        for name, axis in (("lat", latitude), ("lon", longitude)):
            file.createDimension(name, len(axis))
            file.createVariable(name, "f8", (name,))[:] = axis
        file.createVariable("elevation", "f4", ("lat", "lon"), fill_value=-9999.0)[:] = values
    return path


@pytest.fixture
def relief_of_files() -> Any:
    """Elevations from north to south, at 54.095 N and so on, 7.805 E and so on."""
    return -60.0 - np.random.default_rng(2).uniform(0.0, 5.0, (20, 21))


def test_files_of_both_formats_give_the_same_grid(tmp_path: Path, relief_of_files: Any) -> None:
    tif = geotiff(tmp_path / "a.tif", relief_of_files)
    nc = netcdf(tmp_path / "a.nc", 54.095 - 0.01 * np.arange(20), 7.805 + 0.01 * np.arange(21), relief_of_files)
    grids = [Bathymetry.from_toml({"file": str(path)}).grid() for path in (tif, nc)]
    for grid in grids:
        # The second node from the north, the fourth from the west.
        place = np.array([[np.radians(54.085), np.radians(7.835), 0.0]])
        assert grid.at(grid.offset(place))[0][0] == pytest.approx(-relief_of_files[1, 3], abs=1e-3)
    np.testing.assert_allclose(grids[0].depth, grids[1].depth)
    np.testing.assert_allclose(grids[0].spacing, [1112.8, 655.0], rtol=2e-3)
    part = Bathymetry.from_toml({"file": str(nc), **PLACE, "extent_m": [8000, 6000]}).grid()
    assert part.depth.shape == (8, 10)


def test_a_part_may_lie_across_the_edge_of_a_world(tmp_path: Path) -> None:
    latitude, longitude = np.arange(50.0, 52.1, 0.5), np.arange(0.0, 360.1, 0.5)
    depth = 100.0 + 10.0 * (np.remainder(longitude + 180.0, 360.0) - 180.0)  # deeper to the east of Greenwich
    path = netcdf(tmp_path / "world.nc", latitude, longitude, -np.tile(np.maximum(depth, 1.0), (len(latitude), 1)))
    place = {"latitude_deg": 51.0, "longitude_deg": 0.0, "extent_m": [130e3, 300e3]}
    grid = Bathymetry.from_toml({"file": str(path), **place}).grid()
    assert grid.depth[0].tolist() == [80.0, 85.0, 90.0, 95.0, 100.0, 105.0, 110.0, 115.0, 120.0]
    west = np.array([[np.radians(51.0), np.radians(-1.0), 0.0]])
    assert grid.at(grid.offset(west))[0][0] == pytest.approx(90.0, abs=0.01)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"latitude_deg": 50.0, "longitude_deg": 7.9}, r"it spans 53\.9050 to 54\.0950 N, .* latitude_deg = 50.* else"),
        ({"roughness_m": 3.0}, "roughness: it is of a random relief; with a file leave it out"),
        ({"variable": "depht"}, "variable = 'depht' is no grid"),
        ({"file": "none.nc"}, "none.nc: cannot be read: No such file"),
        ({"file": "notes.txt"}, r"should end in .tif or .tiff \(GeoTIFF\), or .nc or .grd"),
        ({"file": "utm.tif"}, "its coordinates are not latitude and longitude; gdalwarp"),
        ({"file": "plain.tif"}, "it has no geographic reference"),
        ({"file": "land.tif"}, "the elevation 3 m, which is land, at 54.0950 N, 7.8050 E, and 1 nodes"),
        ({"file": "uneven.nc"}, "the steps between its latitudes differ"),
        ({"file": "text.nc"}, "cannot be read as NetCDF"),
    ],
)  # fmt: skip
def test_bad_files_are_one_sentence(tmp_path: Path, relief_of_files: Any, change: dict[str, Any], words: str) -> None:
    latitude, longitude = 54.095 - 0.01 * np.arange(20), 7.805 + 0.01 * np.arange(21)
    netcdf(tmp_path / "a.nc", latitude, longitude, relief_of_files)
    netcdf(tmp_path / "uneven.nc", latitude + 1e-4 * np.arange(20) ** 2, longitude, relief_of_files)
    (tmp_path / "notes.txt").write_text("depth")
    (tmp_path / "text.nc").write_text("depth")
    geotiff(tmp_path / "utm.tif", relief_of_files, model=1)
    tifffile.imwrite(tmp_path / "plain.tif", relief_of_files.astype(np.float32))
    relief_of_files[0, 0] = 3.0
    geotiff(tmp_path / "land.tif", relief_of_files)
    table = {"file": "a.nc"} | change
    with pytest.raises(SpecError, match=words) as caught:
        Bathymetry.from_toml(table | {"file": str(tmp_path / table["file"])}).grid()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("library", "ending"), [("tifffile", "tif"), ("netCDF4", "nc")])
def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: Any, library: str, ending: str) -> None:
    (tmp_path / f"a.{ending}").touch()
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(SpecError, match=rf"needs the library {library}: pip install 'simnav\[bathymetry\]'"):
        Bathymetry.from_toml({"file": str(tmp_path / f"a.{ending}")})


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"longitude_deg": 7.9}, "belong together"),
        ({}, "latitude_deg and longitude_deg of the middle are missing"),
        (PLACE | {"hurst": 1.0}, "hurst"),
        (PLACE | {"spacing_m": 0.01}, "makes 400001 by 400001 nodes"),
        (PLACE | {"variable": "z"}, "variable and values belong to a file"),
    ],
)
def test_bad_figures_are_refused(table: dict[str, Any], words: str) -> None:
    with pytest.raises(SpecError, match=words):
        Bathymetry.from_toml(table)


def test_a_scenario_on_another_grid_or_in_the_ground_is_refused() -> None:
    table: dict[str, Any] = {
        "name": "elsewhere", "version": 1, "title": "x", "duration_s": 10,
        "start": {"latitude_deg": 55.0, "longitude_deg": 7.9}, "vessel": {"kind": "uuv"},
        "surroundings": {"bathymetry": dict(PLACE)}, "instruments": {"depth": {"sigma_m": 0.1}},
    }  # fmt: skip
    with pytest.raises(SpecError, match=r"the voyage starts elsewhere: 55.0000 N, 7.9000 E is outside of the grid"):
        Scenario.from_toml(table)
    table["start"] = PLACE | {"depth_m": 200.0}
    with pytest.raises(SpecError, match=r"start.depth_m = 200 is below the bottom, which surroundings.bathymetry has"):
        Scenario.from_toml(table)
    table |= {"start": dict(PLACE), "water_depth_m": 100.0}
    with pytest.raises(SpecError, match=r"surroundings.bathymetry: water_depth_m says the same; leave out one of both"):
        Scenario.from_toml(table)
    table["surroundings"]["bathymetry"]["depth_m"] = 5.0
    del table["water_depth_m"]
    with pytest.raises(SpecError, match="make land"):
        Scenario.from_toml(table)


def test_a_grid_takes_arrays_of_any_form() -> None:
    """Read-only ones, whole numbers, and places that are not known."""
    depth = np.arange(12.0).reshape(3, 4)
    depth.flags.writeable = False
    grid = DepthGrid(np.zeros(3), np.array([10.0, 10.0]), depth)
    found, gradient = grid.at(np.broadcast_to([1, 2], (2, 2)))
    np.testing.assert_allclose(found, 6.118)
    np.testing.assert_allclose(gradient, [[0.434, 0.1]] * 2)
    way, _, met = grid.distance(np.zeros((1, 2), int), np.zeros(1, int), np.array([[0, 0, 1]]))
    assert (way.tolist(), met.tolist()) == ([5.5], [True])
    assert np.isnan(grid.at(np.array([[np.nan, 0.0]]))[0]).all()
