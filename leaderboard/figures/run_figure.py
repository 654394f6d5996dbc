"""From recordings and trials to what `simnav.leaderboard.figures.plots` draws."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from simnav.geometry.earth import relative_position
from simnav.scoring import errors
from simnav.sensors.faults import effect_of
from simnav.spec import UNITS
from simnav.types import KINDS, Array

from .plots import Curve, Track, run_chart
from .sky_view import sky_view
from .style import Style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from simnav.recording import Recording
    from simnav.scenario import Scenario
    from simnav.trial import Trial

__all__ = ["fault_spans", "fixes", "innovation_unit", "outage_spans", "relative_track", "run_figure", "true_track"]

_AXES = (
    ("North error [m]", 0, 1.0),
    ("East error [m]", 1, 1.0),
    ("Down error [m]", 2, 1.0),
    ("Heading error [deg]", 8, np.degrees(1.0)),
)
_MOST_DIAGNOSTICS = 10
_WIDEST_LABEL = 20  # characters of a line of a label, so that it is no longer than its panel is high
#: Of diagnostics of single instruments (`simnav.scoring.plot_series.DIAGNOSTICS`), but for innovations.
_UNITS = {"doubt": "-", "nis": "-", "residual": "sigma", "since": "s", "weight": "-"}


def _origin(recording: Recording) -> Array:
    origin = recording.initial_truth.position[0]
    return np.where(np.isfinite(origin), origin, recording.start.position)


def _track(label: str, position: Array, origin: Array) -> Track:
    ned = relative_position(position, origin)
    return Track(label, ned[:, 1], ned[:, 0])


def relative_track(label: str, position: Array, recording: Recording) -> Track:
    """Track of positions (n, 3) of a run, from its start; the height does not matter."""
    flat = position.copy()
    flat[:, 2] = 0.0
    return _track(label, flat, _origin(recording))


def true_track(recording: Recording) -> Track:
    """Track of the truth, or of a log's reference, from the start."""
    states = np.vstack([recording.initial_truth.position, recording.data.truth.position])
    return _track("truth", states[np.isfinite(states[:, :2]).all(axis=1)], _origin(recording))


def fixes(recording: Recording, most: int = 1500) -> dict[str, Track]:
    """Position fixes as delivered, by instrument, thinned to ``most``."""
    found = {}
    for stream in recording.data.aids.values():
        if KINDS[stream.kind].role == "fix" and KINDS[stream.kind].geodetic and len(stream):
            value = stream.value[:: max(1, len(stream) // most)]
            if value.shape[1] == 2:  # a horizontal fix
                value = np.column_stack([value, np.zeros(len(value))])
            found[f"{stream.name} fixes"] = _track(stream.name, value, _origin(recording))
    return found


def outage_spans(recording: Recording, most: int = 12) -> list[tuple[float, float, str]]:
    """Start, end [s] and name of the run's outages; none where there are too many to tell apart."""
    spans: dict[tuple[float, float], list[str]] = {}
    for fault in recording.faults:
        if effect_of(fault.kind) == "missing":
            start, end = fault.start, min(fault.end, recording.duration)
            for name in fault.instruments:
                for channel in fault.channels or ("",):
                    for span in _without(recording, name, channel, start, end):
                        spans.setdefault(span, []).append(f"{name}:{channel}" if channel else name)
    if len(spans) > most:
        return []
    return [(a, b, f"no {', '.join(dict.fromkeys(names))}") for (a, b), names in sorted(spans.items()) if a < b]


def fault_spans(recording: Recording, most: int = 12) -> list[tuple[float, float, str]]:
    """Start, end [s] and name of the run's faults but for outages; none where there are too many to tell apart."""
    found = []
    for fault in recording.faults:
        if effect_of(fault.kind) != "missing":
            sources = [f"{n}:{c}" if c else n for n in fault.instruments for c in fault.channels or ("",)]
            name = " ".join([fault.kind.replace("_", " "), ", ".join(sources)]).strip()
            found.append((fault.start, min(fault.end, recording.duration), name))
    return sorted(span for span in found if span[0] < span[1]) if len(found) <= most else []


def _without(recording: Recording, name: str, channel: str, start: float, end: float) -> list[tuple[float, float]]:
    """When within an outage an instrument gives nothing: all through it, unless it takes single measurements away.

    With a channel it is that channel that gives nothing.
    """
    stream = recording.data.aids.get(name)
    if stream is None:
        return [(start, end)]
    given, dropped = stream.time, stream.dropped
    if channel in stream.channels:
        c = stream.channels.index(channel)
        given, dropped = given[stream.channel == c], dropped[stream.dropped_channel == c]
    elif stream.channels:
        given, dropped = np.unique(given), np.setdiff1d(dropped, given)
    if not np.any((given >= start) & (given < end)):
        return [(start, end)]
    time = np.concatenate([given, dropped])
    order = np.argsort(time, kind="stable")
    time, lost = time[order], (np.arange(len(time)) >= len(given))[order]
    lost &= (time >= start) & (time < end)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
    ends = np.append(time, end)
    return [(float(time[i]), float(min(ends[j], end))) for i, j in edges.reshape(-1, 2)]


def run_figure(
    recording: Recording,
    trials: Sequence[tuple[str, Trial]],
    references: Sequence[str] = (),
    scenario: Scenario | None = None,
) -> Figure:
    """The figure of ``simnav run --plot``.

    Parameters
    ----------
    recording : Recording
        The run.
    trials : sequence of (label, Trial)
        Those without any epoch are left out.
    references : sequence of str
        Labels of those that are told the truth.
    scenario : Scenario or None
        Of the run; it has the obstacles around a receiver of raw observations.
    """
    shown = [(label, trial, errors(trial, recording)) for label, trial in trials if len(trial)]
    style = Style((label for label, _, _ in shown), references)
    panels: dict[str, list[Curve]] = {}
    for title, column, factor in _AXES:
        curves = []
        for label, trial, error in shown:
            e = error[:, column]
            if not np.isfinite(e).any():
                continue
            bound = None
            if trial.covariance is not None:
                variance = np.where(np.isfinite(e), trial.covariance[:, column, column], np.nan)
                bound = 3.0 * factor * np.sqrt(np.maximum(variance, 0.0))
            curves.append(Curve(label, trial.time, factor * e, bound))
        if curves:
            panels[title] = curves
    tracks = [
        relative_track(label, np.where(trial.estimated[:, :3], trial.position, np.nan), recording)
        for label, trial, _ in shown
    ]
    note = f", {recording.note}" if recording.note else ""
    return run_chart(
        true_track(recording),
        tracks,
        panels,
        style,
        fixes=fixes(recording),
        outages=outage_spans(recording),
        faults=fault_spans(recording),
        diagnostics=_diagnostics(shown, recording),
        bounds={_label(f"nis.{name}", _UNITS["nis"]): _nis_bound(name, recording) for name in recording.data.aids},
        sky=sky_view(recording, scenario),
        title=f"{recording.scenario}, seed {recording.seed}{note}",
    )


def _nis_bound(name: str, recording: Recording) -> float:
    """The NIS of an instrument below which 95 % lie if all is as the filter assumes: of chi-square."""
    from scipy.special import chdtri  # to import scipy.stats takes 0.8 s

    return float(chdtri(len(KINDS[recording.data.aids[name].kind].components), 0.05))


def innovation_unit(kind: str) -> tuple[str, float] | None:
    """Unit of the length of an innovation of a kind of instrument, and what an SI value is multiplied with.

    None where the components of a measurement differ in their units, so that the length has none.

    >>> innovation_unit("speed_log"), innovation_unit("gnss_position")
    (('m/s', 1.0), ('m', 1.0))
    """
    shared = {c.error_unit for c in KINDS[kind].components}
    if len(shared) > 1:
        return None
    unit = shared.pop()
    return unit.replace("_", "/"), 1.0 / UNITS[unit]


def _label(name: str, unit: str) -> str:
    """Of the panel of a diagnostic: ``nis.speed_log`` on two lines, with its unit."""
    quantity, dot, instrument = name.replace("_", " ").partition(".")
    words = f"{instrument if dot else quantity}{f' [{unit}]' if unit else ''}"
    return "\n".join([*([quantity] if dot else []), *textwrap.wrap(words, _WIDEST_LABEL, break_long_words=False)])


def _diagnostics(shown: Sequence[tuple[str, Trial, Array]], recording: Recording) -> dict[str, list[Curve]]:
    """The diagnostics that most estimators give, one panel each; of an array, its mean over the components.

    Those of the channels of one instrument (``nis.INSTRUMENT:CHANNEL``) have one panel together, with the mean over its
    channels (``nis.INSTRUMENT``) where an estimator gives it.

    Where not all can be shown, those of an instrument or of the motion go before counters, and what says whether an
    instrument is wrong goes first.
    """
    found: dict[str, list[Curve]] = {}
    for label, trial, _ in shown:
        for name, values in trial.diagnostics.items():
            v = np.asarray(values, dtype=np.float64).reshape(len(trial), -1)
            if v.shape[1] and np.isfinite(v).any():
                count = np.isfinite(v).sum(axis=1)
                mean = np.where(count > 0, np.nansum(v, axis=1) / np.maximum(count, 1), np.nan)
                if np.nanmax(mean) == np.nanmin(mean):
                    continue  # it says nothing over time
                panel, _, channel = name.partition(":")
                found.setdefault(panel, []).append(Curve(label, trial.time, mean, channel=channel))
    labels = {name: len({c.label for c in curves}) for name, curves in found.items()}

    def order(name: str) -> tuple[bool, int, bool]:
        return not name.startswith("doubt."), -labels[name], "." not in name

    most = sorted(found.items(), key=lambda item: order(item[0]))[:_MOST_DIAGNOSTICS]
    panels = {}
    for name, curves in most:
        unit, factor = _unit(name, recording)
        panels[_label(name, unit)] = [replace(c, values=factor * c.values) for c in curves]
    return panels


def _unit(name: str, recording: Recording) -> tuple[str, float]:
    """Unit of a diagnostic, empty where it is not known, and factor from SI."""
    quantity, _, instrument = name.partition(".")
    if quantity == "innovation" and instrument in recording.data.aids:
        return innovation_unit(recording.data.aids[instrument].kind) or ("", 1.0)
    return _UNITS.get(quantity, "") if instrument else "", 1.0
