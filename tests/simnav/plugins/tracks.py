"""The track of a recording as GeoJSON, which web maps can show."""

from __future__ import annotations

import json

import numpy as np

from simnav.leaderboard.results.formats import writes


@writes("recording", "geojson")
def write_geojson(recording, path):
    """The true track."""
    points = [
        [float(np.degrees(lon)), float(np.degrees(lat)), float(height)]
        for lat, lon, height in recording.data.truth.position
    ]
    path.write_text(json.dumps({"type": "LineString", "coordinates": points}))
    return [path]
