"""The charts of a dial: error against it, errors at one of its values, and maps over two dials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .charts import COLOUR, ZOOM_HELP, Chart, Spec, bands_of, lines_of, quantity, tips

__all__ = ["at_value", "dial", "dial_map"]


def dial(name: str, across: str, up: str, data: Mapping[str, Any], caption: str, *, breaking: bool = True) -> Chart:
    """Error against a dial, with the values at which estimators break if ``breaking``.

    Parameters
    ----------
    data : mapping
        ``curves``: by row ``value`` (of the dial), ``middle``, ``low``, ``high``, ``failed``; ``marks``: by row ``at``
        and ``threshold``, one each.
    """
    x, y = quantity("value", across), quantity("middle", up, log=True)
    curves = {"data": {"name": "curves"}, "transform": [{"filter": "datum.middle > 0"}]}
    sure = {"data": {"name": "curves"}, "transform": [{"filter": "datum.low > 0"}]}
    layers: list[Spec] = [
        bands_of(sure, x, y),
        lines_of(curves, {"x": x, "y": y}),
        {
            **curves,
            "mark": {"type": "point", "filled": True, "size": 35},
            "encoding": {
                "x": x,
                "y": y,
                "color": COLOUR,
                "tooltip": tips(row="Estimator", value=across, middle=up, low="Low", high="High", failed="Failed runs"),
            },
        },
        {
            "data": {"name": "marks"},
            "mark": {"type": "point", "shape": "cross", "size": 130, "filled": True, "angle": 45},
            "encoding": {
                "x": {**x, "field": "at"},
                "y": {**y, "field": "threshold"},
                "color": COLOUR,
                "tooltip": tips(row="Estimator", at="Breaks at", threshold="Twice its clean error"),
            },
        },
    ]
    crosses = " Crosses: breaking points, where the error passes twice that at the clean value." if breaking else ""
    chosen: Spec = {  # by the slider of the page
        "data": {"name": "at"},
        "mark": {"type": "rule", "color": "$grey", "strokeWidth": 1.5},
        "encoding": {"x": {**x, "field": "value"}},
    }
    title, spec = f"Error against {across}", {"height": 300, "layer": [*layers, chosen] if breaking else layers[:-1]}
    return Chart(name, title, f"{caption}{crosses} {ZOOM_HELP}", spec, data, byrow=True)


def at_value(name: str, across: str, up: str, ends: Sequence[float], caption: str) -> Chart:
    """Errors of all estimators at one value of a dial, which the reader chooses.

    The page puts in the data: ``steps`` with ``row``, ``middle``, ``low``, ``high``, ``failed``. The axis goes over
    ``ends``, whatever value is chosen.
    """
    x = quantity("middle", up, log=True)
    if ends:
        x["scale"] |= {"domain": list(ends)}
    y = {
        "field": "row",
        "type": "nominal",
        "title": None,
        "sort": {"field": "middle", "op": "min", "order": "ascending"},
    }
    known = {"data": {"name": "steps"}, "transform": [{"filter": "datum.middle > 0"}]}
    layers: list[Spec] = [
        {
            "data": {"name": "steps"},
            "transform": [{"filter": "datum.low > 0 && datum.high > 0"}],
            "mark": {"type": "rule", "strokeWidth": 2.2},
            "encoding": {"x": {**x, "field": "low"}, "x2": {"field": "high"}, "y": y, "color": COLOUR},
        },
        {
            **known,
            "mark": {"type": "point", "filled": True, "size": 70, "opacity": 1},
            "encoding": {
                "x": x,
                "y": y,
                "color": COLOUR,
                "tooltip": tips(row="Estimator", middle=up, low="Low", high="High", failed="Failed runs"),
            },
        },
        {
            "data": {"name": "steps"},
            "transform": [{"filter": "!isValid(datum.middle)"}],
            "mark": {"type": "text", "align": "left", "fontSize": 11, "color": "$ink"},
            "encoding": {"x": {"value": 6}, "y": y, "text": {"value": "half of its runs fail or more"}},
        },
    ]
    return Chart(
        name, f"Errors at one value of the {across}", caption, {"height": {"step": 26}, "layer": layers}, byrow=True
    )


def dial_map(name: str, across: str, up: str, label: str, data: Mapping[str, Any], caption: str) -> Chart:
    """Error over two dials, a panel an estimator, as the figure of ``simnav sweep`` has it.

    Parameters
    ----------
    across, up : str
        Titles of the dials.
    label : str
        Title of the error.
    data : mapping
        ``curves``: cells by row: ``x``, ``y`` (values of the dials), ``error``, ``text``, ``dark`` (whether the cell
        has a dark colour).
    """
    sides = {
        axis: {
            "field": axis,
            "type": "ordinal",
            "title": title,
            "sort": order,
            "axis": {"labelAngle": 0, "format": "~g"},
        }
        for axis, title, order in (("x", across, "ascending"), ("y", up, "descending"))
    }
    colour = {
        "field": "error",
        "type": "quantitative",
        "scale": {"type": "log", "scheme": "$scheme"},
        "legend": {"title": label, "orient": "bottom"},
    }
    known, failed = ([{"filter": f"{sign}isValid(datum.error)"}] for sign in ("", "!"))
    tooltip = tips(row="Estimator", x=across, y=up, error=label)
    text = {**sides, "text": {"field": "text"}, "tooltip": tooltip}
    ink = {"condition": {"test": "datum.dark", "value": "#ffffff"}, "value": "#1b2430"}
    mark = {"type": "text", "fontSize": 11}
    inner: list[Spec] = [
        {"transform": known, "mark": "rect", "encoding": {**sides, "color": colour, "tooltip": tooltip}},
        {"transform": known, "mark": mark, "encoding": {**text, "color": ink}},
        {"transform": failed, "mark": {"type": "rect", "color": "$shade", "opacity": 0.4}, "encoding": sides},
        {"transform": failed, "mark": {**mark, "color": "$ink"}, "encoding": text},
    ]
    spec = {
        "data": {"name": "curves"},
        "facet": {"field": "row", "type": "nominal", "title": None, "sort": None},
        "columns": 4,
        "spec": {"layer": inner},
    }
    return Chart(name, f"Error over {across} and {up}", caption, spec, data, byrow=True, wide=True)
