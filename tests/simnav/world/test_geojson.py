"""Obstacles from a GeoJSON file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from simnav.geometry.earth import displace
from simnav.scenario import parse
from simnav.spec import SpecError
from simnav.world.geojson import read_buildings
from simnav.world.obstacles import ObstacleMap, Obstacles

ORIGIN = np.array([np.radians(53.54), np.radians(9.98), 0.0])
SQUARE = [(40.0, -100.0), (40.0, 100.0), (60.0, 100.0), (60.0, -100.0)]  # north, east [m]


def ring(corners, closed=True) -> list[list[float]]:
    places = [displace(ORIGIN, np.array([north, east, 0.0])) for north, east in corners]
    points = [[float(np.degrees(p[1])), float(np.degrees(p[0]))] for p in places]
    return [*points, points[0]] if closed else points


def feature(corners=SQUARE, kind="Polygon", **properties) -> dict:
    polygon = [ring(corners)]
    coordinates = polygon if kind == "Polygon" else [polygon]
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def written(folder: Path, *features: dict) -> Path:
    path = folder / "harbour.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}))
    return path


def test_a_file_makes_the_same_map_as_a_table(tmp_path: Path):
    bridge = [(-200.0, 300.0), (-200.0, 320.0), (200.0, 320.0), (200.0, 300.0)]
    path = written(
        tmp_path,
        feature(name="warehouse", height="20 m"),
        {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": [[9.9, 53.5]]}},
        feature(bridge, "MultiPolygon", top_m=34.0, bottom_m=30),
    )
    table = [{"corners_m": SQUARE, "top_m": 20.0}, {"corners_m": bridge, "top_m": 34.0, "bottom_m": 30.0}]
    place = {"latitude_deg": 53.54, "longitude_deg": 9.98}
    plain = ObstacleMap(Obstacles.from_toml({**place, "obstacle": table}))
    read = ObstacleMap(Obstacles.from_toml({**place, "file": str(path)}))
    rng = np.random.default_rng(1)
    position = np.array([displace(ORIGIN, np.array([n, e, -5.0])) for n, e in rng.uniform(-30.0, 30.0, (50, 2))])
    elevation, azimuth = rng.uniform(0.05, 1.5, (50, 8)), rng.uniform(0.0, 6.28, (50, 8))
    a, b = (m.paths(position, np.zeros((50, 3)), elevation, azimuth) for m in (plain, read))
    np.testing.assert_array_equal(a.blocked, b.blocked)
    assert 20 < a.blocked.sum() < 380
    finite = np.isfinite(a.excess)
    np.testing.assert_array_equal(finite, np.isfinite(b.excess))
    np.testing.assert_allclose(a.excess[finite], b.excess[finite], atol=1e-3)


def test_the_path_is_relative_to_the_scenario_and_the_content_counts(tmp_path: Path):
    path = written(tmp_path, feature(top_m=20.0))
    text = """name = "quay"
version = 1
title = "alongside"
duration_s = 20.0
[start]
latitude_deg = 53.54
longitude_deg = 9.98
[instruments.gnss]
kind = "gnss_raw"
satellites = ["G12", "G29", "E27"]
sigma_pseudorange_m = 0.3
sigma_range_rate_m_s = 0.05
[surroundings.obstacles]
kind = "obstacles"
file = "harbour.geojson"
"""
    scenario = parse(text, folder=tmp_path)
    before = scenario.content_hash()
    assert scenario.surroundings["obstacles"].file == str(path.resolve())
    path.write_text(path.read_text().replace("20.0", "25.0"))
    assert parse(text, folder=tmp_path).content_hash() != before
    with pytest.raises(SpecError, match=r"absent\.geojson: cannot be read: No such file"):
        parse(text.replace("harbour", "absent"), folder=tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not valid GeoJSON"),
        ("[1, 2]", "type = None should be 'FeatureCollection'"),
        (json.dumps({"type": "Topology"}), "type = 'Topology' should be"),
        (json.dumps({"type": "FeatureCollection", "features": []}), "there is no polygon"),
        (json.dumps(feature()), "feature 1: there is no height; the properties should have 'top_m' or 'height'"),
        (json.dumps(feature(height="tall")), "feature 1: height = 'tall' should be a number of metres"),
        (json.dumps(feature(top_m=True)), "feature 1: top_m = True should be a number of metres"),
        (json.dumps(feature(SQUARE[:2], top_m=3.0)), "a polygon has three corners or more, not 2"),
        (json.dumps(feature(top_m=3.0)).replace("53.", "153."), r"is no place; coordinates should be long"),
        (json.dumps({**feature(top_m=3.0), "geometry": {"type": "Polygon", "coordinates": [["a"]]}}),
         r"its coordinates should be rings of \[longitude, latitude\] in degrees"),
        ("[" * 100_000, "not valid GeoJSON"),
    ],
)  # fmt: skip
def test_a_wrong_file_gets_a_sentence(tmp_path: Path, content: str, message: str):
    path = tmp_path / "harbour.geojson"
    path.write_text(content)
    with pytest.raises(SpecError, match=message) as caught:
        read_buildings(path)
    assert str(path) in str(caught.value)


def test_a_thousand_broken_files_give_a_sentence_each(tmp_path: Path):
    rng, whole = np.random.default_rng(5), written(tmp_path, feature(name="a", top_m=3.0)).read_bytes()
    read = 0
    for _ in range(1000):
        broken = bytearray(whole)
        for at in rng.integers(0, len(broken), rng.integers(1, 6)):
            broken[at] = rng.integers(0, 256)
        path = tmp_path / "broken.geojson"
        path.write_bytes(bytes(broken))
        try:
            Obstacles.from_toml({"file": str(path)})
            read += 1
        except SpecError:
            pass
    assert 5 < read < 950


def test_heights_in_the_wrong_order(tmp_path: Path):
    path = written(tmp_path, feature(name="roof", top_m=3.0, bottom_m=4.0))
    with pytest.raises(SpecError, match=r"obstacle 'roof': top_m = 3 should be above bottom_m = 4"):
        Obstacles.from_toml({"file": str(path)})
    with pytest.raises(SpecError, match="latitude_deg and longitude_deg of the origin are missing"):
        Obstacles.from_toml({})


def test_a_file_is_read_once_and_again_after_a_change(tmp_path: Path):
    path = written(tmp_path, feature(name="warehouse", height="20 m"))
    assert read_buildings(path)[0] is read_buildings(path)[0]
    written(tmp_path, feature(name="warehouse", height="21 m"), feature(name="shed", height=3.0))
    assert [b.top for b in read_buildings(path)] == [21.0, 3.0]
