"""The moving picture of one run: the voyage on a chart, and a close-up that goes with the vessel.

The close-up has the true vessel in its middle. Around it are the fixes and estimates of the last seconds, each relative
to where the vessel was then. Fixes that a fault affected have another colour. The newest estimates have the ellipses
that hold the truth with a probability of 95 %, if the estimates are right.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.leaderboard.results.files import write_whole
from simnav.types import KINDS

from .run_figure import fault_spans, relative_track
from .style import GREY, INK, PALETTE, PAPER, Style, figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from simnav.recording import Recording
    from simnav.trial import Trial

__all__ = ["moving_picture"]

Array = NDArray[np.float64]

_MILLISECONDS = 90  # of a frame
_SIZE, _DPI = (7.2, 3.6), 100
_COLOURS = 48  # of a frame: few, so that the file stays small
_SHOWN = 25.0  # time for which fixes and estimates are shown in the close-up [s]
_NARROWEST = 12.0  # half the width of the close-up, at least [m]
_FAULTY = PALETTE[-2][0]
#: 95 % quantile of chi-square with two degrees of freedom.
_QUANTILE = 5.991
#: Outline of a vessel that heads north: east and north.
_VESSEL = np.array([[0.0, 1.0], [0.32, 0.4], [0.32, -0.8], [-0.32, -0.8], [-0.32, 0.4]])


@dataclass(frozen=True, eq=False)
class _Path:
    """Horizontal positions (n, 2), east and north [m], at n times [s]."""

    time: Array
    place: Array

    def at(self, time: float | Array) -> Array:
        """The place at a time, or (k, 2) places at k times, between those that are known."""
        return np.stack([np.interp(time, self.time, self.place[:, i]) for i in (0, 1)], axis=-1)

    def until(self, time: float) -> Array:
        """The places up to a time."""
        return self.place[: int(np.searchsorted(self.time, time, side="right"))]

    def beside(self, truth: _Path) -> _Path:
        """The places relative to those of the vessel at the same times."""
        return _Path(self.time, self.place - truth.at(self.time))


@dataclass(frozen=True, eq=False)
class _Estimates:
    """Of an estimator: its path beside the vessel, and horizontal covariances (n, 2, 2), east and north [m^2]."""

    label: str
    path: _Path
    covariance: Array | None

    def ellipse(self, time: float) -> Array:
        """Outline (k, 2) of the newest ellipse around the estimate [m]; empty without a covariance."""
        k = int(np.searchsorted(self.path.time, time, side="right")) - 1
        if self.covariance is None or k < 0 or not np.isfinite(self.covariance[k]).all():
            return np.empty((0, 2))
        values, axes = np.linalg.eigh(self.covariance[k])
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        circle = np.stack([np.cos(angle), np.sin(angle)])
        outline: Array = (axes @ (np.sqrt(_QUANTILE * np.maximum(values, 0.0))[:, None] * circle)).T
        return outline


@dataclass(frozen=True, eq=False)
class _Fixes:
    """Position fixes by the time of validity, and whether a fault affected each of the n."""

    path: _Path
    faulty: NDArray[np.bool_]


def moving_picture(
    recording: Recording,
    trials: Sequence[tuple[str, Trial]],
    path: Path,
    references: Sequence[str] = (),
    frames: int = 110,
) -> Path:
    """Write the moving picture of ``simnav run --animate``.

    Parameters
    ----------
    recording : Recording
        The run.
    trials : sequence of (label, Trial)
        Those without any epoch are left out.
    path : Path
        The file, a GIF.
    references : sequence of str
        Labels of those that are told the truth.
    frames : int
        Number of pictures, evenly over the run.

    Returns
    -------
    Path
        The file.
    """
    from PIL import Image

    images = [
        Image.fromarray(frame).quantize(_COLOURS, dither=Image.Dither.NONE)
        for frame in _frames(recording, [(label, trial) for label, trial in trials if len(trial)], references, frames)
    ]
    written = io.BytesIO()
    images[0].save(
        written, "GIF", save_all=True, append_images=images[1:], duration=_MILLISECONDS, loop=0, optimize=True
    )
    return write_whole(path, written.getvalue())


def _frames(
    recording: Recording, trials: Sequence[tuple[str, Trial]], references: Sequence[str], count: int
) -> Iterator[NDArray[np.uint8]]:
    """The frames as (h, w, 3) arrays."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    truth, heading = _truth(recording)
    estimates = [_estimates(label, trial, recording, truth) for label, trial in trials]
    style, fixes, spans = Style((e.label for e in estimates), references), _fixes(recording), fault_spans(recording)
    with styled():
        fig = figure(*_SIZE)
        fig.set_facecolor("white")
        fig.set_dpi(_DPI)
        chart, close = fig.subplots(1, 2, width_ratios=[1.0, 1.25])
        canvas, half = FigureCanvasAgg(fig), _NARROWEST
        _legend(fig, estimates, style)
        for time in np.linspace(truth.time[0], truth.time[-1], count):
            here, course = truth.at(time), float(np.interp(time, truth.time, heading))
            far = max(float(np.hypot(*e.path.at(time))) for e in estimates)
            half += 0.35 * (max(_NARROWEST, 1.5 * far) - half)  # the close-up follows, without jumps
            for axes in (chart, close):
                axes.clear()
                axes.set(xticks=[], yticks=[], aspect="equal")
                axes.grid(visible=False)
                for spine in axes.spines.values():
                    spine.set(visible=True, color=GREY)
            _draw_chart(chart, truth, fixes, here, course, time)
            _draw_close_up(close, truth, fixes, course, time, half)
            for e in estimates:
                _draw_estimate(close, e, style.colour(e.label), time)
            active = ", ".join(name for start, end, name in spans if start <= time <= end)
            chart.set_title(f"{recording.scenario}, {time:.0f} s", fontsize=9)
            close.set_title(f"fault: {active}" if active else "close-up", fontsize=9, color=_FAULTY if active else INK)
            said = "\n".join(f"{e.label}: {np.hypot(*e.path.at(time)):.1f} m" for e in estimates)
            close.text(0.03, 0.97, said, transform=close.transAxes, va="top", fontsize=8)
            canvas.draw()  # type: ignore[no-untyped-call]
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]


def _truth(recording: Recording) -> tuple[_Path, Array]:
    """The true path, and the heading [rad] at its times, continuous."""
    states = recording.data.truth
    known = np.isfinite(states.position[:, :2]).all(axis=1)
    track = relative_track("truth", states.position[known], recording)
    heading = np.nan_to_num(states.attitude[known, 2])
    return _Path(states.time[known], np.column_stack([track.east, track.north])), np.unwrap(heading)


def _estimates(label: str, trial: Trial, recording: Recording, truth: _Path) -> _Estimates:
    track = relative_track(label, trial.position, recording)
    path = _Path(trial.time, np.column_stack([track.east, track.north])).beside(truth)
    # from north and east to east and north
    covariance = None if trial.covariance is None else trial.covariance[:, :2, :2][:, ::-1, ::-1]
    return _Estimates(label, path, covariance)


def _fixes(recording: Recording) -> list[_Fixes]:
    """Fixes of all instruments that measure a position."""
    found = []
    for stream in recording.data.aids.values():
        if KINDS[stream.kind].role == "fix" and KINDS[stream.kind].geodetic and len(stream):
            position = np.column_stack([stream.value[:, :2], np.zeros(len(stream))])
            track = relative_track(stream.name, position, recording)
            path = _Path(stream.time, np.column_stack([track.east, track.north]))
            found.append(_Fixes(path, stream.faults > 0))
    return found


def _legend(fig: Figure, estimates: Sequence[_Estimates], style: Style) -> None:
    from matplotlib.lines import Line2D

    def dot(colour: str, label: str) -> Any:
        return Line2D([], [], color=colour, marker="o", ms=4, ls="none", label=label)

    handles = [
        dot(INK, "vessel"), dot(GREY, "fix"), dot(_FAULTY, "fix with a fault"),
        *(Line2D([], [], color=style.colour(e.label), lw=1.6, label=f"{e.label}, 95 % ellipse") for e in estimates),
    ]  # fmt: skip
    fig.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8)


def _draw_chart(axes: Axes, truth: _Path, fixes: Sequence[_Fixes], here: Array, course: float, time: float) -> None:
    """The whole voyage: the true track, grey ahead of the vessel, and the fixes so far that a fault affected."""
    axes.plot(*truth.place.T, color="0.85", lw=2.0)
    axes.plot(*truth.until(time).T, color=INK, lw=1.4)
    for f in fixes:
        until = f.path.until(time)
        axes.plot(*until[f.faulty[: len(until)]].T, ".", color=_FAULTY, ms=2.5)
    low, high = truth.place.min(axis=0), truth.place.max(axis=0)
    span = max(float((high - low).max()), 2.0 * _NARROWEST)
    middle = (low + high) / 2.0
    axes.set(xlim=middle[0] + np.array([-0.6, 0.6]) * span, ylim=middle[1] + np.array([-0.6, 0.6]) * span)
    _draw_vessel(axes, here, course, 0.05 * span)
    _draw_scale(axes, span * 1.2)


def _draw_close_up(axes: Axes, truth: _Path, fixes: Sequence[_Fixes], course: float, time: float, half: float) -> None:
    """The vessel, and the fixes of the last seconds beside it."""
    for f in fixes:
        shown, place = (f.path.time <= time) & (f.path.time > time - _SHOWN), f.path.beside(truth).place
        for which, colour in ((shown & ~f.faulty, GREY), (shown & f.faulty, _FAULTY)):
            axes.plot(*place[which].T, ".", color=colour, ms=6, mew=0)
    axes.set(xlim=(-1.2 * half, 1.2 * half), ylim=(-half, half))
    _draw_vessel(axes, np.zeros(2), course, 0.09 * half)
    _draw_scale(axes, 2.4 * half)


def _draw_estimate(axes: Axes, estimates: _Estimates, colour: str, time: float) -> None:
    """The last seconds, place and ellipse of an estimate beside the vessel."""
    now = estimates.path.at(time)
    axes.plot(*estimates.path.at(np.linspace(time - _SHOWN, time, 26)).T, color=colour, lw=1.3)
    axes.plot(*now, "o", color=colour, ms=5)
    outline = now + estimates.ellipse(time)
    axes.fill(*outline.T, facecolor=colour, alpha=0.25)
    axes.plot(*outline.T, color=colour, lw=1.2)


def _draw_vessel(axes: Axes, here: Array, course: float, size: float) -> None:
    """A vessel, larger than it is, with its bow in the direction of its heading [rad]."""
    c, s = np.cos(course), np.sin(course)
    outline = here + size * _VESSEL @ np.array([[c, -s], [s, c]])
    axes.fill(*outline.T, facecolor=INK, edgecolor=PAPER, lw=0.8, zorder=5)


def _draw_scale(axes: Axes, width: float) -> None:
    """A bar of a round length, for axes that are so wide [m]."""
    tens = 10.0 ** np.floor(np.log10(width / 4.0))
    length = max(k * tens for k in (1.0, 2.0, 5.0) if k * tens <= width / 4.0)
    left, low = axes.get_xlim()[0], axes.get_ylim()[0]
    start, height = left + 0.04 * width, low + 0.04 * width
    axes.plot([start, start + length], [height, height], color=INK, lw=2.0)
    text = f"{length / 1000.0:g} km" if length >= 1000.0 else f"{length:g} m"
    axes.text(start, height + 0.015 * width, text, fontsize=8, va="bottom")
