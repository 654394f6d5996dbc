"""The charts of the site as Vega-Lite specifications: from plain columns to JSON.

A specification holds no data and no colours. Data are columns, or curves by row, which the page expands
(``charts.js``); ``$colours`` and ``$dashes`` stand for the scales of the rows that are shown, ``$ink`` and the like for
colours of the theme, which the page or `simnav.leaderboard.site.print_figures` puts in.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from simnav.leaderboard.figures.appearance import EAST, HORIZONTAL_ERROR, NORTH, PROTECTION_LEVEL, TIME

from .labels import GAP, LETTER, WIDE

__all__ = [
    "COLOUR",
    "COST_HEIGHT",
    "DETECTION_HEIGHT",
    "NO_BOUND",
    "NO_FAULTS",
    "ZOOM_HELP",
    "Chart",
    "accuracy_and_cost",
    "bands_of",
    "columns",
    "detection",
    "distribution",
    "front_colour",
    "front_names",
    "lines_of",
    "over_time",
    "quantity",
    "ratios_by_group",
    "spread",
    "spread_data",
    "stanford",
    "timed",
    "timeline",
    "tips",
    "track",
]

Spec = dict[str, Any]

#: Heights of charts whose names are set apart [pixels].
COST_HEIGHT, DETECTION_HEIGHT = 340.0, 300.0

#: Zoom by the wheel with Shift, so that the page still scrolls; a double click shows all again.
_ZOOM = {
    "name": "zoom",
    "select": {"type": "interval", "zoom": "wheel![event.shiftKey]"},
    "bind": "scales",
}
ZOOM_HELP = "Drag to move, Shift and wheel to zoom, double click to see all again."


@dataclass(frozen=True)
class Chart:
    """A chart of a page.

    Attributes
    ----------
    name : str
        Unique on its page.
    title, caption : str
        Title and explanation of the chart.
    spec : dict
        Vega-Lite, with placeholders.
    data : mapping
        By name: columns, or ``{"axis", "name", "rows"}``: curves by row over a common axis.
    byrow : bool
        Whether it shows the rows that the reader chose.
    equal : bool
        Whether both axes have one scale; ``data["frame"]`` holds what must be seen.
    wide : bool
        Whether it takes the whole width of the page.
    """

    name: str
    title: str
    caption: str
    spec: Spec
    data: Mapping[str, Any] = field(default_factory=dict)
    byrow: bool = False
    equal: bool = False
    wide: bool = False

    def to_dict(self) -> dict[str, Any]:
        """For the page."""
        return dict(vars(self))


def columns(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> dict[str, list[Any]]:
    """A data set as columns, from its rows.

    >>> columns(("row", "value"), [("ekf", 1.0), ("ukf", 2.0)])
    {'row': ['ekf', 'ukf'], 'value': [1.0, 2.0]}
    """
    listed = list(rows)
    return {name: [row[k] for row in listed] for k, name in enumerate(names)}


#: Data of `over_time` where there are no faults, or no bound.
NO_FAULTS: Mapping[str, list[Any]] = columns(("start", "end", "name"), ())
NO_BOUND: Mapping[str, list[Any]] = columns(("time", "bound"), ())


def timed(
    curves: Mapping[str, Any], faults: Mapping[str, Any] = NO_FAULTS, bound: Mapping[str, Any] = NO_BOUND
) -> dict[str, Any]:
    """The data of `over_time`."""
    return {"curves": curves, "faults": faults, "bound": bound}


def quantity(name: str, title: str, *, log: bool = False, **more: Any) -> Spec:
    """A place on an axis, by a number."""
    scale = {"type": "log", "nice": False} if log else {"zero": False, "nice": False}
    return {"field": name, "type": "quantitative", "title": title, "scale": scale, **more}


def _roomy(axis: Spec, pixels: int = 14) -> Spec:
    """With room for the marks at the ends."""
    return {**axis, "scale": {**axis["scale"], "padding": pixels}}


COLOUR = {"field": "row", "type": "nominal", "scale": "$colours", "legend": None}
_ROW = {"color": COLOUR, "strokeDash": {**COLOUR, "scale": "$dashes"}}


def lines_of(curves: Spec, encoding: Spec) -> Spec:
    """A line a row, which zooms."""
    return {
        **curves,
        "params": [_ZOOM],
        "mark": {"type": "line", "clip": True, "strokeWidth": 1.7},
        "encoding": {**encoding, **_ROW},
    }


def bands_of(curves: Spec, x: Spec, y: Spec) -> Spec:
    """A band a row, from ``low`` to ``high``, of the first three rows that are shown: more hide each other."""
    first = {"filter": {"field": "row", "oneOf": "$banded"}}
    return {
        **curves,
        "transform": [*curves.get("transform", ()), first],
        "mark": {"type": "area", "opacity": 0.13},
        "encoding": {"x": x, "y": {**y, "field": "low"}, "y2": {"field": "high"}, "color": COLOUR},
    }


def tips(**fields: str) -> list[Spec]:
    """Fields that are shown on hover, with their headings; figures have three digits."""
    return [
        {"field": name, "title": title} if name in _TEXTS else {"field": name, "title": title, "format": ".3~g"}
        for name, title in fields.items()
    ]


_TEXTS = {"row", "name", "run", "family", "scenario", "group", "status", "words", "seed"}


def _hover(points: Spec, tooltip: list[Spec]) -> Spec:
    """Points that appear on hover, nearest first."""
    return {
        **points,
        "params": [
            {"name": "near", "select": {"type": "point", "on": "pointerover", "nearest": True, "clear": "pointerout"}}
        ],
        "mark": {"type": "point", "size": 45, "filled": True},
        "encoding": {
            **points["encoding"],
            "opacity": {"condition": {"param": "near", "empty": False, "value": 1}, "value": 0},
            "tooltip": tooltip,
        },
    }


def over_time(
    name: str,
    title: str,
    unit: str,
    data: Mapping[str, Any],
    caption: str,
    *,
    spread: bool = True,
    log: bool = True,
) -> Chart:
    """A figure over time: median with band (or one run), faults shaded, bound dashed.

    Parameters
    ----------
    data : mapping
        As of `timed`. ``curves``: curves by row over ``time`` with ``middle`` (and ``low``, ``high``); ``faults``:
        columns ``start``, ``end``, ``name``; ``bound``: columns ``time``, ``bound``.
    """
    x = quantity("time", TIME)
    y = quantity("middle", f"{title} [{unit}]", log=log)
    kept = "datum.middle > 0" if log else "isValid(datum.middle)"
    curves = {"data": {"name": "curves"}, "transform": [{"filter": kept}]}
    layers: list[Spec] = [
        {
            "data": {"name": "faults"},
            "mark": {"type": "rect", "color": "$shade", "opacity": 0.22},
            "encoding": {
                "x": {"field": "start", "type": "quantitative"},
                "x2": {"field": "end"},
                "tooltip": tips(name="Fault", start="From [s]", end="To [s]"),
            },
        },
        *([bands_of(curves, x, y)] if spread else []),
        lines_of(curves, {"x": x, "y": y}),
        {
            "data": {"name": "bound"},
            "mark": {"type": "line", "clip": True, "color": "$ink", "strokeDash": [3, 3], "strokeWidth": 1.4},
            "encoding": {"x": x, "y": {**y, "field": "bound"}},
        },
        _hover(
            {**curves, "encoding": {"x": x, "y": y, "color": COLOUR}},
            tips(row="Estimator", time=TIME, middle=f"{title} [{unit}]"),
        ),
    ]
    return Chart(
        name, f"{title} over time", f"{caption} {ZOOM_HELP}", {"height": 300, "layer": layers}, data, byrow=True
    )


def distribution(name: str, title: str, unit: str, data: Mapping[str, Any], caption: str) -> Chart:
    """Share of the epochs whose error is below a value; ``curves``: ``error`` by row over ``share``."""
    x, y = quantity("error", f"{title} [{unit}]", log=True), quantity("share", "Share of the epochs [%]")
    curves = {"data": {"name": "curves"}, "transform": [{"filter": "datum.error > 0"}]}
    layers: list[Spec] = [
        lines_of(curves, {"x": x, "y": y, "order": {"field": "share"}}),
        {
            "data": {"values": [{"level": 50}, {"level": 95}]},
            "mark": {"type": "rule", "color": "$grey", "strokeDash": [2, 2]},
            "encoding": {"y": {"field": "level", "type": "quantitative"}},
        },
        _hover(
            {**curves, "encoding": {"x": x, "y": y, "color": COLOUR}},
            tips(row="Estimator", error=f"{title} [{unit}]", share="Share of the epochs [%]"),
        ),
    ]
    return Chart(
        name,
        f"Distribution of the {title.lower()}",
        f"{caption} {ZOOM_HELP}",
        {"height": 280, "layer": layers},
        data,
        byrow=True,
    )


def track(name: str, title: str, data: Mapping[str, Any], caption: str) -> Chart:
    """A horizontal track: truth (``truth``), fixes, where faults act, estimates (``curves``)."""
    x, y = quantity("east", EAST), quantity("north", NORTH)
    order = {"order": {"field": "time"}}
    layers: list[Spec] = [
        {
            "data": {"name": "fixes"},
            "mark": {"type": "point", "color": "$grey", "opacity": 0.5, "size": 8, "filled": True},
            "encoding": {"tooltip": tips(name="Fix", time=TIME)},
        },
        {
            "data": {"name": "faulty"},
            "mark": {"type": "line", "color": "$second", "opacity": 0.35, "strokeWidth": 9, "strokeCap": "round"},
            "encoding": {"detail": {"field": "part"}, "tooltip": tips(name="Fault"), **order},
        },
        {"data": {"name": "truth"}, "mark": {"type": "line", "color": "$ink", "strokeWidth": 2.4}, "encoding": order},
        {
            "data": {"name": "curves"},
            "params": [_ZOOM],
            "mark": {"type": "line", "clip": True, "strokeWidth": 1.4},
            "encoding": {**_ROW, **order},
        },
        {
            "data": {"name": "ends"},
            "mark": {"type": "point", "filled": True, "size": 60, "color": "$ink", "opacity": 1},
            "encoding": {
                "shape": {
                    "field": "name",
                    "legend": None,
                    "scale": {"domain": ["start", "end"], "range": ["circle", "square"]},
                },
                "tooltip": tips(name="Truth"),
            },
        },
        _hover({"data": {"name": "curves"}, "encoding": {"color": COLOUR}}, tips(row="Estimator", time=TIME)),
    ]
    return Chart(
        name,
        title,
        f"{caption} {ZOOM_HELP}",
        {"encoding": {"x": x, "y": y}, "layer": layers},
        data,
        byrow=True,
        equal=True,
    )


def accuracy_and_cost(name: str, y_title: str, plain: str, data: Mapping[str, Any], missing: str = "") -> Chart:
    """Error against processor time, with the rows that no other row beats in both.

    Parameters
    ----------
    name, y_title : str
        Name of the chart; title of the axis of errors.
    plain : str
        The row that processor times are multiples of.
    data : mapping
        ``rows``: columns ``row``, ``cost`` (multiple), ``low``, ``high`` (its 95 % interval), ``error``, ``family``,
        ``front`` (bool), and the columns of `simnav.leaderboard.site.labels.shifts`.
    missing : str
        A sentence on the rows whose cost was not measured, for the caption.
    """
    cost = f"Processor time (× {plain})"
    x = _roomy(quantity("cost", cost, log=True))
    y = _roomy(quantity("error", y_title, log=True), _NAME_ROOM)
    rows = {"data": {"name": "rows"}}
    layers: list[Spec] = [
        {
            **rows,
            "transform": [{"filter": "datum.front"}],
            "mark": {"type": "line", "interpolate": "step-after", "color": "$grey", "strokeDash": [4, 3]},
            "encoding": {"x": x, "y": y},
        },
        {
            **rows,
            "mark": {"type": "rule", "clip": True, "opacity": 0.55},
            "encoding": {
                "x": {**x, "field": "low"},
                "x2": {"field": "high"},
                "y": y,
                "color": front_colour(),
            },
        },
        {
            **rows,
            "params": [_ZOOM],
            "mark": {"type": "point", "filled": True, "size": 60, "clip": True},
            "encoding": {
                "x": x,
                "y": y,
                "color": front_colour(),
                "opacity": {"condition": {"test": "datum.front", "value": 1}, "value": 0.55},
                "tooltip": tips(
                    row="Estimator",
                    family="Family",
                    cost=cost,
                    low="95 % interval, from",
                    high="to",
                    error=y_title,
                ),
            },
        },
        rows | front_names({"x": x, "y": y}),
    ]
    caption = (
        "Each point is an estimator. Those in the other colour form the Pareto front: no estimator is both more "
        "accurate and quicker. Lines: 95 % interval of the processor time, which is a multiple of that of "
        f"{plain}, measured in turns with it.{' ' * bool(missing)}{missing} {ZOOM_HELP}"
    )
    return Chart(name, "Accuracy against cost", caption, {"height": COST_HEIGHT, "layer": layers}, data)


def detection(name: str, data: Mapping[str, Any]) -> Chart:
    """Share of faults that are detected against that of false alarms [%].

    Parameters
    ----------
    data : mapping
        ``rows``: columns ``row``, ``found``, ``false``, ``front`` (bool), and those of
        `simnav.leaderboard.site.labels.shifts`.
    """
    x, y = quantity("false", "False alarms [%]"), quantity("found", "Faults detected [%]")
    place = {"x": _roomy(x), "y": _roomy(y, _NAME_ROOM)}
    tip = tips(row="Estimator", found="Faults detected [%]", false="False alarms [%]")
    layers: list[Spec] = [
        {
            "params": [_ZOOM],
            "mark": {"type": "point", "filled": True, "size": 60, "clip": True},
            "encoding": {**place, "color": front_colour(), "tooltip": tip},
        },
        front_names(place),
    ]
    caption = (
        "An estimator at the upper left detects every fault and raises no false alarm. Names: no other estimator "
        f"detects more faults with fewer false alarms. {ZOOM_HELP}"
    )
    spec = {"height": DETECTION_HEIGHT, "data": {"name": "rows"}, "layer": layers}
    return Chart(name, "Detection against false alarms", caption, spec, data)


def front_colour() -> Spec:
    """Another colour for the points of a Pareto front."""
    return {"condition": {"test": "datum.front", "value": "$second"}, "value": "$strong"}


def front_names(place: Spec) -> Spec:
    """The names of the points of a Pareto front: to the left of them where the right edge would cut the name.

    The data have ``row``, and ``shift`` and ``shift_narrow`` as from `simnav.leaderboard.site.labels.shifts`.
    """
    at = f"scale('x', datum['{place['x']['field']}'])"
    left = f"{at} > width / 2 && {at} + {GAP} + {LETTER} * length(datum.row) > width"
    return {
        "transform": [{"filter": "datum.front"}],
        "mark": {
            "type": "text",
            "align": {"expr": f"{left} ? 'right' : 'left'"},
            "dx": {"expr": f"{left} ? {-GAP} : {GAP}"},
            "baseline": "bottom",
            "dy": {"expr": f"width < {WIDE} ? datum.shift_narrow : datum.shift"},
            "fontSize": 11,
            "color": "$ink",
        },
        "encoding": {**place, "text": {"field": "row"}},
    }


_NAME_ROOM = 26  # for a name above the highest point [pixels]


def spread(
    name: str, title: str, x_title: str, data: Mapping[str, Any], caption: str, *, ideal: Sequence[float] = ()
) -> Chart:
    """A figure of every run (``runs``: ``row``, ``value``, ``run``), with the middle of each row (``middles``).

    ``ideal`` are one or two values that are best: a line, or a band.
    """
    order = list(data["middles"]["row"])
    y = {"field": "row", "type": "nominal", "title": None, "sort": order}
    x = _roomy(quantity("value", x_title, log=True))
    layers: list[Spec] = []
    if len(ideal) == 2:
        layers.append(
            {
                "data": {"values": [{"low": ideal[0], "high": ideal[1]}]},
                "mark": {"type": "rect", "color": "$shade", "opacity": 0.25},
                "encoding": {"x": {"field": "low", "type": "quantitative"}, "x2": {"field": "high"}},
            }
        )
    layers += [
        {
            "data": {"name": "runs"},
            "mark": {"type": "tick", "opacity": 0.4, "thickness": 1.2, "color": "$strong"},
            "encoding": {"x": x, "y": y, "tooltip": tips(row="Estimator", run="Run", value=x_title)},
        },
        {
            "data": {"name": "middles"},
            "mark": {"type": "rule", "strokeWidth": 2.2, "color": "$ink"},
            "encoding": {"x": {**x, "field": "low"}, "x2": {"field": "high"}, "y": y},
        },
        {
            "data": {"name": "middles"},
            "mark": {"type": "point", "filled": True, "size": 55, "opacity": 1, "color": "$ink"},
            "encoding": {"x": x, "y": y, "tooltip": tips(row="Estimator", value=x_title, low="Low", high="High")},
        },
    ]
    return Chart(name, title, caption, {"height": {"step": 17}, "layer": layers}, data)


def spread_data(runs: Iterable[Sequence[Any]], middles: Iterable[Sequence[Any]]) -> dict[str, dict[str, list[Any]]]:
    """The data of `spread`: from (row, value, run) of every run, and (row, value, low, high) of each row."""
    return {
        "runs": columns(("row", "value", "run"), runs),
        "middles": columns(("row", "value", "low", "high"), middles),
    }


def stanford(name: str, data: Mapping[str, Any], limit: float, caption: str) -> Chart:
    """Epochs by error and protection level, a panel a row.

    Parameters
    ----------
    data : mapping
        ``curves``: cells by row: ``x``, ``x2`` (error), ``y``, ``y2`` (protection level), ``epochs``.
    limit : float
        Alert limit [m].
    """
    end = 2.0 * limit
    x, y = ({"field": f, "type": "quantitative", "title": title, "scale": {"domain": [0.0, end], "nice": False}}
            for f, title in (("x", HORIZONTAL_ERROR), ("y", PROTECTION_LEVEL)))  # fmt: skip
    regions = [{"x": 0.0, "x2": end, "y": limit, "y2": end, "what": "not available"},
               {"x": limit, "x2": end, "y": 0.0, "y2": limit, "what": "hazardously misleading"}]  # fmt: skip
    diagonal = [{"x": 0.0, "y": 0.0}, {"x": end, "y": end}]
    sides = {"x": x, "x2": {"field": "x2"}, "y": y, "y2": {"field": "y2"}}
    inner = [
        {
            "data": {"values": regions},
            "mark": {"type": "rect", "opacity": 0.18},
            "encoding": {
                **sides,
                "color": {"condition": {"test": "datum.y > 0", "value": "$shade"}, "value": "$second"},
                "tooltip": {"field": "what", "title": "Region"},
            },
        },
        {
            "mark": "rect",
            "encoding": {
                **sides,
                "color": {
                    "field": "epochs",
                    "type": "quantitative",
                    "scale": {"type": "log", "scheme": "$scheme"},
                    "legend": {"title": "Epochs", "orient": "bottom"},
                },
                "tooltip": tips(row="Estimator", x="Error from [m]", y="Level from [m]", epochs="Epochs"),
            },
        },
        {
            "data": {"values": diagonal},
            "mark": {"type": "line", "color": "$grey", "strokeWidth": 1},
            "encoding": {"x": x, "y": y},
        },
    ]
    spec = {
        "data": {"name": "curves"},
        "facet": {"field": "row", "type": "nominal", "title": None, "sort": None},
        "columns": 6,
        "spec": {"layer": inner},
    }
    words = (
        f"{caption} Below the diagonal the error exceeds the protection level: the estimator misleads. Grey: the "
        f"level is above the alert limit of {limit:g} m, so that the navigator is warned. Red: the error is above "
        "that limit without a warning. What is beyond the axes counts at their ends."
    )
    return Chart(name, "Stanford diagrams: error against protection level", words, spec, data, byrow=True, wide=True)


def timeline(name: str, data: Mapping[str, Any], caption: str, duration: float) -> Chart:
    """What happens when, in a run of some length [s]: columns ``group``, ``name``, ``start``, ``end``, ``words``."""
    spec = {
        "height": {"step": 26},
        "data": {"name": "events"},
        "mark": {"type": "bar", "height": 16, "cornerRadius": 3},
        "encoding": {
            "x": {**quantity("start", TIME), "scale": {"domain": [0.0, duration], "nice": False}},
            "x2": {"field": "end"},
            "y": {"field": "group", "type": "nominal", "title": None, "sort": None},
            "color": {"condition": {"test": "datum.group == 'manoeuvres'", "value": "$shade"}, "value": "$second"},
            "stroke": {"value": "$ink"},
            "strokeWidth": {"value": 0.5},
            "tooltip": tips(name="What", start="From [s]", end="To [s]", words="How"),
        },
    }
    return Chart(name, "What happens when", caption, spec, data, wide=True)


def ratios_by_group(name: str, data: Mapping[str, Any], caption: str) -> Chart:
    """How an estimator does under each kind of difficulty: columns ``group``, ``row``, ``value``, ``scenario``."""
    layers: list[Spec] = [
        {
            "mark": {"type": "rule", "color": "$grey"},
            "data": {"values": [{"one": 1}]},
            "encoding": {"x": {"field": "one", "type": "quantitative"}},
        },
        {
            "mark": {"type": "point", "filled": True, "size": 60, "opacity": 0.9},
            "encoding": {
                "x": _roomy(quantity("value", "Error, as a multiple of the reference figure", log=True)),
                "y": {"field": "group", "type": "nominal", "title": None, "sort": None},
                "yOffset": {"field": "row", "type": "nominal"},
                "color": {"condition": {"test": "datum.plain", "value": "$grey"}, "value": "$second"},
                "shape": {"condition": {"test": "datum.plain", "value": "diamond"}, "value": "circle"},
                "tooltip": tips(row="Estimator", scenario="Scenario", value="Multiple of the reference"),
            },
        },
    ]
    spec = {"height": {"step": 30}, "data": {"name": "points"}, "layer": layers}
    return Chart(name, "Robustness profile", caption, spec, data)
