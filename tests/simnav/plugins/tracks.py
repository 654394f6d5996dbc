"""The track of a recording as GPX, which charts can show."""

from __future__ import annotations

import numpy as np

from simnav.leaderboard.results.formats import writes


@writes("recording", "gpx")
def write_gpx(recording, path):
    """The true track."""
    points = [
        f'<trkpt lat="{np.degrees(lat):.9f}" lon="{np.degrees(lon):.9f}"><ele>{height:.3f}</ele></trkpt>'
        for lat, lon, height in recording.data.truth.position
    ]
    track = "\n".join(points)
    path.write_text(f'<gpx version="1.1" creator="simnav"><trk><trkseg>\n{track}\n</trkseg></trk></gpx>\n')
    return [path]
