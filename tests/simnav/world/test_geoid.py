"""The geoid from a grid that PROJ reads, under a depth sensor."""

from __future__ import annotations

import builtins
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from simnav.scenario import Scenario, parse
from simnav.simulation.simulator import simulate
from simnav.spec import SpecError
from simnav.world.geoid import read_geoid
from tests.cases.depth_sensor import HEAD

pytest.importorskip("pyproj")

#: Where the package proj-data of Debian has EGM96 on 15'.
EGM96 = Path("/usr/share/proj/egm96_15.gtx")


def grid(folder: Path, name: str = "plane.gtx", middle: float = 54.0) -> Path:
    """A GTX grid of the plane 40 + 3 (latitude - 54) - 2 (longitude - 8) m, in degrees, on 0.25 degrees."""
    rows, columns, step = 9, 9, 0.25
    south, west = middle - 1.0, 7.0
    latitude = south + step * np.arange(rows)[:, None]
    longitude = west + step * np.arange(columns)[None]
    value = 40.0 + 3.0 * (latitude - 54.0) - 2.0 * (longitude - 8.0)
    file = folder / name
    file.write_bytes(struct.pack(">4d2i", south, west, step, step, rows, columns) + value.astype(">f4").tobytes())
    return file


def scenario(folder: Path, text: str = 'geoid_grid = "plane.gtx"') -> Scenario:
    return parse(f"{HEAD}[surroundings.water_level]\n{text}\n", folder=folder)


def test_a_depth_sensor_takes_the_geoid_for_the_surface(tmp_path: Path) -> None:
    grid(tmp_path)
    recording = simulate(scenario(tmp_path), 1)
    stream, truth = recording.data.aids["depth"], recording.data.truth
    latitude, longitude, altitude = (np.interp(stream.time, truth.time, c) for c in truth.position.T)
    undulation = 40.0 + 3.0 * (np.degrees(latitude) - 54.0) - 2.0 * (np.degrees(longitude) - 8.0)
    np.testing.assert_allclose(stream.value[:, 0] + altitude, undulation, atol=2e-3)
    assert np.ptp(undulation) > 0.02


def test_the_content_of_the_grid_counts_in_the_digest(tmp_path: Path) -> None:
    file = grid(tmp_path)
    first = scenario(tmp_path)
    before = first.content_hash()
    assert Scenario.from_toml(first.to_toml()) == first
    file.write_bytes(file.read_bytes()[:-4] + struct.pack(">f", 7.0))
    assert scenario(tmp_path).content_hash() != before
    without = scenario(tmp_path, "geoid_m = 0.0")
    assert "geoid_grid" not in str(without.model_dump())


@pytest.mark.skipif(not EGM96.is_file(), reason="needs the package proj-data of Debian")
def test_egm96_has_the_undulations_that_its_makers_print() -> None:
    """The test values of the program of the National Geospatial-Intelligence Agency for EGM96, in metres."""
    printed = np.array([
        [38.6281550, 269.7791550, -31.628], [-14.6212170, 305.0211140, -2.969], [46.8743190, 102.4487290, -43.575],
        [-23.6174460, 133.8747120, 15.871], [38.6254730, 359.9995000, 50.066], [-0.4667440, 0.0023000, 17.329],
    ])  # fmt: skip
    position = np.radians(printed)
    found = read_geoid(str(EGM96)).undulation(position)
    np.testing.assert_allclose(found, printed[:, 2], atol=0.08)  # linear on 15'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'geoid_grid = "none.gtx"',
            r"geoid_grid = '.*none.gtx': there is no such file, and no none.gtx in the folders",
        ),
        ('geoid_grid = "words.gtx"', r"words.gtx: PROJ cannot read it as a grid of vertical shifts"),
        ('geoid_grid = "elsewhere.gtx"', r"elsewhere.gtx: the grid has no value at 54.0000 N, 8.0000 E"),
        ('geoid_grid = "plane.gtx"\ngeoid_m = 1.0', r"geoid_m and geoid_slope_mm_km go without"),
    ],
)
def test_bad_grids_are_one_sentence(tmp_path: Path, text: str, message: str) -> None:
    grid(tmp_path)
    grid(tmp_path, "elsewhere.gtx", 30.0)
    (tmp_path / "words.gtx").write_text("no grid")
    with pytest.raises(SpecError, match=message):
        scenario(tmp_path, text)


def test_without_the_library_it_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = grid(tmp_path, "other.gtx")
    monkeypatch.delitem(sys.modules, "pyproj", raising=False)
    original = builtins.__import__

    def refuse(name: str, *rest: object) -> object:
        if name == "pyproj":
            raise ImportError(name)
        return original(name, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(SpecError, match=r"pip install 'simnav\[geoid\]'"):
        read_geoid(str(file))
