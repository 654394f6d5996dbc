"""Charts of a scenario with satellites: the sky over a run, and the place with the errors of ranges along the track."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.figures.appearance import EAST, NORTH, TIME

from .charts import Chart, columns, quantity, tips
from .rounding import short

if TYPE_CHECKING:
    from simnav.leaderboard.figures.sky_view import SkyView

__all__ = ["sky_charts", "sky_data"]

#: Words of `simnav.leaderboard.figures.sky_view.State`, in its order.
_STATES = ("not received", "received", "error by a reflection", "fault")
_COLOURS = ("$shade", "$strong", "$second", "$ink")
#: Points of a satellite, and of the track.
_PASSAGE, _TRACK = 40, 240
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 73)
_WINDS = (("N", 0.0), ("E", 90.0), ("S", 180.0), ("W", 270.0))
_RIM = 97.0  # where the names of the directions stand


def sky_data(view: SkyView | None) -> dict[str, Any]:
    """Data of both charts, by their names; empty without satellites."""
    if view is None:
        return {}
    spots, names = [], []
    for c, satellite in enumerate(view.satellites):
        known = np.flatnonzero(np.isfinite(view.elevation[:, c]))
        for k in _kept(known, view.state[known, c]):
            elevation, azimuth = np.degrees(view.elevation[k, c]), np.degrees(view.azimuth[k, c]) % 360.0
            state = _STATES[view.state[k, c]]
            spots.append((*_at(elevation, azimuth), satellite, state, short(elevation), short(azimuth),
                          short(view.time[k])))  # fmt: skip
        names.append((spots[-1][0], spots[-1][1], satellite))
    spots.sort(key=lambda spot: (spot[3] != _STATES[1], _STATES.index(spot[3])))  # what is wrong lies above
    rings = [
        (*_at(float(elevation), float(np.degrees(angle))), elevation, k)
        for elevation in (0, 30, 60)
        for k, angle in enumerate(_CIRCLE)
    ]
    kept = range(0, len(view.time), max(1, -(-len(view.time) // _TRACK)))
    heard = (view.state > 0).sum(axis=1)
    place = [
        (short(view.east[k]), short(view.north[k]), short(view.time[k]), short(view.error[k]), int(heard[k]))
        for k in kept
    ]
    walls = [
        (short(east), short(north), f"{o.name}, {o.top:.0f} m high", part, k)
        for part, o in enumerate(view.outlines)
        for k, (east, north) in enumerate(zip(_closed(o.east), _closed(o.north), strict=True))
    ]
    return {
        "sky": {
            "spots": columns(("x", "y", "satellite", "state", "elevation", "azimuth", "time"), spots),
            "names": columns(("x", "y", "satellite"), names),
            "rings": columns(("x", "y", "elevation", "order"), rings),
            "winds": columns(("x", "y", "wind"), ((*_at(90.0 - _RIM, angle), name) for name, angle in _WINDS)),
            "frame": {"x": [-100.0, 100.0], "y": [-100.0, 100.0]},
        },
        "place": {
            "walls": columns(("east", "north", "what", "part", "order"), walls),
            "place": columns(("east", "north", "time", "error", "heard"), place),
            "frame": {"x": _frame(view.east), "y": _frame(view.north)},
        },
    }


def _kept(known: Any, state: Any) -> list[int]:
    """Epochs of a satellite: some at even steps, and each on which its state changes, or something is wrong."""
    step = max(1, -(-len(known) // _PASSAGE))
    return [
        int(k)
        for n, k in enumerate(known)
        if n % step == 0 or n == len(known) - 1 or state[n] >= 2 or state[n] != state[n - 1]
    ]


def _at(elevation: float, azimuth: float) -> tuple[float, float]:
    """A direction [deg] on the chart: the zenith in the middle, north above, east to the right."""
    away, angle = 90.0 - elevation, np.radians(azimuth)
    return round(float(away * np.sin(angle)), 2), round(float(away * np.cos(angle)), 2)


def _closed(values: Iterable[float]) -> list[float]:
    every = list(values)
    return [*every, every[0]]


def _frame(values: Any) -> list[float]:
    """What must be seen: the track, and 100 m beside it."""
    return [float(np.min(values)) - 100.0, float(np.max(values)) + 100.0]


def sky_charts(data: Mapping[str, Any], seed: str) -> list[Chart]:
    """The charts of what `sky_data` gave; none without satellites."""
    if not data:
        return []
    made = [Chart("sky", "Satellites over the run", f"Of seed {seed}. The zenith is in the middle, the horizon at the "
                  "rim.", _sky(), data["sky"], equal=True)]  # fmt: skip
    errors = any(data["place"]["place"]["error"])
    colour = ("error", "Largest error of a range [m]") if errors else ("heard", "Satellites received")
    around = " Grey: obstacles." if data["place"]["walls"]["part"] else ""
    title = "Errors of ranges along the track" if errors else "Satellites along the track"
    return [*made, Chart("place", title, f"Of seed {seed}.{around}", _place(*colour), data["place"], equal=True)]


def _sky() -> dict[str, Any]:
    bare = {"axis": None, "type": "quantitative"}
    text = {"type": "text", "color": "$ink", "fontSize": 10}
    shown = tips(satellite="Satellite", state="Signal", elevation="Elevation [deg]", azimuth="Azimuth [deg]", time=TIME)
    ring = {"type": "line", "color": "$grid", "strokeWidth": 1}
    return {
        "view": {"stroke": None},
        "encoding": {"x": {"field": "x", **bare}, "y": {"field": "y", **bare}},
        "layer": [
            {"data": {"name": "rings"}, "mark": ring,
             "encoding": {"detail": {"field": "elevation"}, "order": {"field": "order"}}},
            {"data": {"name": "winds"}, "mark": text, "encoding": {"text": {"field": "wind"}}},
            {"data": {"name": "spots"}, "mark": {"type": "point", "filled": True, "size": 22, "opacity": 1},
             "encoding": {"color": {"field": "state", "type": "nominal",
                                    "scale": {"domain": list(_STATES), "range": list(_COLOURS)},
                                    "legend": {"title": None, "orient": "bottom", "columns": 2}},
                          "tooltip": shown}},
            {"data": {"name": "names"}, "mark": {**text, "dx": 14, "dy": -8},
             "encoding": {"text": {"field": "satellite"}}},
        ],
    }  # fmt: skip


def _place(column: str, title: str) -> dict[str, Any]:
    scale: dict[str, Any] = {"scheme": "$scheme"}
    if column == "error":
        scale |= {"type": "symlog", "constant": 0.3}
    shown = tips(time=TIME, error="Largest error of a range [m]", heard="Satellites received")
    return {
        "encoding": {"x": quantity("east", EAST), "y": quantity("north", NORTH)},
        "layer": [
            {"data": {"name": "walls"},
             "mark": {"type": "line", "color": "$grey", "strokeWidth": 1.5, "clip": True},
             "encoding": {"detail": {"field": "part"}, "order": {"field": "order"}, "tooltip": tips(what="Obstacle")}},
            {"data": {"name": "place"}, "mark": {"type": "point", "filled": True, "size": 30, "opacity": 1},
             "encoding": {"color": {"field": column, "type": "quantitative", "scale": scale,
                                    "legend": {"title": title, "orient": "bottom", "gradientLength": 180}},
                          "tooltip": shown}},
        ],
    }  # fmt: skip
