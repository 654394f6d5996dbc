"""The chart of a running episode: truth, fixes and estimate in the plane; below, the error over time and a close-up.

The chart is for people, so it shows the truth. Memory is bounded: when a trace is full, every second point is removed.
Matplotlib is imported by the first `Chart`.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import relative_position
from simnav.types import Array

__all__ = ["Chart", "Trace"]

_log = logging.getLogger("simnav")

_INK, _GRID = "#33414e", "#dde3e8"
_RECENT = 200
#: 95 % quantile of chi-square with two degrees of freedom.
_ELLIPSE = 5.991
_TRUTH, _ESTIMATE, _FIX, _FAULT = "#33414e", "#d1495b", "#6aa9d8", "#edae49"


class Trace:
    """A series of points in bounded memory: when it is full, every second point is removed.

    Parameters
    ----------
    width : int
        Number of values of a point.
    capacity : int
        Largest number of points, an even number.
    largest : int, optional
        Index of a column in which the largest value between two kept points is kept, so that no peak is lost.
    """

    def __init__(self, width: int, capacity: int = 2048, largest: int | None = None):
        self._data = np.empty((capacity, width))
        self._n = 0
        self._stride = 1
        self._skipped = 0
        self._largest = largest

    def __len__(self) -> int:
        return self._n

    @property
    def points(self) -> Array:
        """(n, width) array of the kept points."""
        return self._data[: self._n]

    def add(self, *point: float) -> None:
        """Append a point."""
        if self._skipped:
            if self._largest is not None:
                last = self._data[self._n - 1]
                last[self._largest] = max(last[self._largest], point[self._largest])
            self._skipped -= 1
            return
        if self._n == len(self._data):
            data, c = self._data, self._largest
            if c is not None:
                data[::2, c] = np.maximum(data[::2, c], data[1::2, c])
            data[: self._n // 2] = data[::2]
            self._n //= 2
            self._stride *= 2
        self._data[self._n] = point
        self._n += 1
        self._skipped = self._stride - 1

    def clear(self) -> None:
        """Remove all points."""
        self._n, self._stride, self._skipped = 0, 1, 0


class Chart:
    """The picture of one run.

    Parameters
    ----------
    title : str
        Title above the picture.
    duration : float
        Length of the run [s].
    human : bool
        Show it in a window, where there is a display.
    """

    def __init__(self, title: str, duration: float, *, human: bool = False):
        self.title = title
        self._duration = duration
        self._truth, self._estimate = Trace(2), Trace(2)
        self._fixes, self._faults = Trace(2), Trace(2)
        self._error = Trace(2, largest=1)
        # for the close-up, all of the last steps
        self._recent: tuple[deque[tuple[float, float]], ...] = tuple(deque(maxlen=_RECENT) for _ in range(4))
        self._origin: Array | None = None
        self._pending: list[tuple[Array, NDArray[np.bool_]]] = []
        self._now = (0.0, 0.0)
        self._ellipse: Array | None = None
        self._window: Any = None
        self._figure: Any = None
        self._background: Any = None  # axes, ticks and words: drawn anew only when the limits change
        self._silent = False
        if human:
            self._window = _open_window()
            self._silent = self._window is None
            self._figure = self._window
        if not self._silent:
            self._build()
        self.clear()

    def clear(self) -> None:
        """Start a new run."""
        for trace in (self._truth, self._estimate, self._fixes, self._faults, self._error):
            trace.clear()
        for recent in self._recent:
            recent.clear()
        self._origin, self._pending, self._now, self._ellipse = None, [], (0.0, 0.0), None
        self._view: tuple[Array, Array] | None = None
        self._span, self._top = 0.0, 0.0

    def add_fixes(self, position: Array, faulty: NDArray[np.bool_]) -> None:
        """Add position fixes of the step that the next `add` ends.

        Parameters
        ----------
        position : (k, 2) array
            Latitude and longitude [rad].
        faulty : (k,) bool array
            True for each fix that a fault affected.
        """
        if len(position) and not self._silent:
            self._pending.append((position, faulty))

    def add(self, time: float, truth: Array, estimate: Array, *, covariance: Array | None = None) -> None:
        """Add the states at the end of a step. Nothing is added if a log has no reference there.

        Parameters
        ----------
        time : float
            End of the step [s].
        truth, estimate : (3,) array
            True and estimated geodetic position [rad, rad, m].
        covariance : (2, 2) array, optional
            Covariance of the estimate, north and east [m^2]. It is drawn as the ellipse with a probability of 95 %.
        """
        if self._silent:
            return
        self._ellipse = None if covariance is None else _ellipse(covariance)
        pending, self._pending = self._pending, []
        if np.isnan(truth[:2]).any():
            return
        truth, estimate = (np.append(position[:2], 0.0) for position in (truth, estimate))  # in the plane
        if self._origin is None:
            self._origin = truth
        north, east, _ = relative_position(np.stack([truth, estimate]), self._origin).T.tolist()
        for trace, recent, point in zip((self._truth, self._estimate), self._recent, zip(east, north)):
            trace.add(*point)
            recent.append(point)
        error = relative_position(estimate, truth)
        self._now = (time, math.hypot(error[0], error[1]))
        self._error.add(*self._now)
        for position, faulty in pending:
            flat = np.concatenate([position, np.zeros((len(position), 1))], axis=1)
            offsets = relative_position(flat, self._origin)
            for (n, e, _), bad in zip(offsets.tolist(), faulty.tolist(), strict=True):
                (self._faults if bad else self._fixes).add(e, n)
                self._recent[3 if bad else 2].append((e, n))

    def frame(self) -> NDArray[np.uint8]:
        """The picture as an (h, w, 3) array of bytes."""
        canvas = self._figure.canvas
        if self._update() or self._background is None:
            canvas.draw()
            self._background = canvas.copy_from_bbox(self._figure.bbox)
        canvas.restore_region(self._background)
        for artist in self._moving:
            self._figure.draw_artist(artist)
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def show(self) -> None:
        """Update the window. Without a display it does nothing."""
        if self._silent:
            return
        self._update()
        self._window.canvas.draw_idle()
        self._window.canvas.flush_events()

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            import matplotlib.pyplot as plt

            plt.close(self._window)
        self._window = self._figure = None
        self._silent = True

    # ------------------------------------------------------------------------------------------- drawing

    def _build(self) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        if self._figure is None:
            self._figure = Figure()
            FigureCanvasAgg(self._figure)
        self._figure.set_size_inches(7.2, 7.2)
        self._figure.set_dpi(100)
        self._chart = chart = self._figure.add_axes((0.11, 0.36, 0.86, 0.58))
        self._below = below = self._figure.add_axes((0.11, 0.075, 0.6, 0.19))
        self._close = close = self._figure.add_axes((0.78, 0.075, 0.19, 0.19))
        for axes in (chart, below, close):
            axes.grid(True, color=_GRID, linewidth=0.8)
            axes.set_axisbelow(True)
            axes.tick_params(colors=_INK, labelsize=8, length=3)
            for side, spine in axes.spines.items():
                spine.set_visible(axes is close or side in ("left", "bottom"))
                spine.set_color(_GRID if axes is close else _INK)
        self._close.set(xlim=(-1.0, 1.0), ylim=(-1.0, 1.0), xticks=[-0.5, 0.0, 0.5], yticks=[-0.5, 0.0, 0.5])
        self._close.tick_params(length=0, labelbottom=False, labelleft=False)
        chart.plot([0], [0], color=_TRUTH, marker="o", markersize=5, markerfacecolor="white", linestyle="none")
        self._on_chart, self._on_close = _track(chart), _track(close)
        (self._outline,) = close.plot([], [], color=_ESTIMATE, linewidth=1.0)
        (self._error_line,) = below.plot([], [], color=_ESTIMATE, linewidth=1.2)
        below.set_ylabel("horizontal error [m]", fontsize=9, color=_INK)
        self._figure.legend(
            handles=self._on_chart[:4],
            loc="upper right",
            bbox_to_anchor=(0.975, 0.995),
            ncols=4,
            fontsize=8.5,
            frameon=False,
            handlelength=1.4,
            columnspacing=1.2,
            labelcolor=_INK,
        )
        self._figure.text(0.11, 0.965, self.title, fontsize=11, color=_INK, weight="bold")
        self._reading = self._figure.text(0.71, 0.272, "", fontsize=9, color=_ESTIMATE, ha="right")
        self._width = self._figure.text(0.875, 0.272, "", fontsize=9, color=_INK, ha="center")
        # dots first: the lines are drawn over them
        self._moving = [a for track in (self._on_chart, self._on_close) for a in (*track[2:4], *track[:2], *track[4:])]
        self._moving += [self._outline, self._error_line, self._reading, self._width]
        for artist in self._moving:
            artist.set_animated(self._window is None)

    def _update(self) -> bool:
        """Set the data of the artists from the traces; return True if the limits of the axes changed."""
        truth, estimate, error = self._truth.points, self._estimate.points, self._error.points
        changed = self._limits(truth, estimate)
        changed |= self._error_limits(float(error[:, 1].max()) if len(error) else 0.0)
        recent = [np.array(points).reshape(-1, 2) for points in self._recent]
        traces = (truth, estimate, self._fixes.points, self._faults.points, recent[0][-1:], recent[1][-1:])
        for artist, trace in zip(self._on_chart, traces, strict=True):
            artist.set_data(trace[:, 0] * self._scale, trace[:, 1] * self._scale)
        self._error_line.set_data(error[:, 0] / self._seconds, error[:, 1])
        if not len(truth):
            recent, here, half = [np.empty((0, 2))] * 4, np.zeros(2), 1.0
            self._reading.set_text("")
            self._width.set_text("")
        else:
            here = recent[0][-1]
            half = _round_up(1.5 * max(self._now[1], 5.0))
            self._reading.set_text(f"{_clock(self._now[0])}    {self._now[1]:.3g} m")
            self._width.set_text(f"close-up, {2 * half:g} m")
        for artist, trace in zip(self._on_close, (*recent, recent[0][-1:], recent[1][-1:]), strict=True):
            artist.set_data((trace[:, 0] - here[0]) / half, (trace[:, 1] - here[1]) / half)
        outline = np.empty((0, 2))
        if self._ellipse is not None and len(truth):
            outline = (recent[1][-1] + self._ellipse - here) / half
        self._outline.set_data(outline[:, 0], outline[:, 1])
        return changed

    def _limits(self, truth: Array, estimate: Array) -> bool:
        """Set the limits of the axes to the truth, and to estimate and fixes as long as the truth is readable."""
        low, high = (truth.min(axis=0), truth.max(axis=0)) if len(truth) else (np.zeros(2), np.zeros(2))
        bound_low, bound_high = low, high
        span = max(float((high - low).max()), 50.0)
        for trace in (estimate, self._fixes.points, self._faults.points):
            if len(trace):
                low = np.minimum(low, np.maximum(trace.min(axis=0), bound_low - span))
                high = np.maximum(high, np.minimum(trace.max(axis=0), bound_high + span))
        if self._view is not None and (low >= self._view[0]).all() and (high <= self._view[1]).all():
            return False
        box = self._chart.bbox
        half = np.maximum((high - low) / 2 * 1.3, span / 4)  # a margin, so that the limits change rarely
        half = max(half[0] / box.width, half[1] / box.height) * np.array([box.width, box.height])  # equal scales
        middle = (low + high) / 2
        self._view = middle - half, middle + half
        self._scale, unit = (1e-3, "km") if half.max() > 2000.0 else (1.0, "m")
        self._chart.set_xlim(*((middle[0] + half[0] * np.array([-1, 1])) * self._scale))
        self._chart.set_ylim(*((middle[1] + half[1] * np.array([-1, 1])) * self._scale))
        self._chart.set_xlabel(f"east of the start [{unit}]", fontsize=9, color=_INK)
        self._chart.set_ylabel(f"north of the start [{unit}]", fontsize=9, color=_INK)
        return True

    def _error_limits(self, largest: float) -> bool:
        span = self._span or min(60.0, self._duration)
        while span < self._now[0] and span < self._duration:
            span = min(2.0 * span, self._duration)
        top = self._top
        if not 0.0 < largest <= top:
            top = max(1.25 * largest, 1e-3)
        if (span, top) == (self._span, self._top):
            return False
        self._span, self._top = span, top
        self._seconds, letter = (3600.0, "h") if span > 7200.0 else (1.0, "s")
        self._below.set_xlim(0.0, span / self._seconds)
        self._below.set_ylim(0.0, top)
        self._below.set_xlabel(f"time [{letter}]", fontsize=9, color=_INK)
        return True


def _track(axes: Any) -> list[Any]:
    """Empty artists: truth, estimate, fixes, faulty fixes, true position, estimated position."""
    dot = {"linestyle": "none", "marker": "o", "markeredgewidth": 0}
    styles: Iterable[dict[str, Any]] = (
        {"color": _TRUTH, "linewidth": 1.6, "label": "truth"},
        {"color": _ESTIMATE, "linewidth": 1.3, "label": "estimate"},
        {"color": _FIX, "markersize": 3.0, "alpha": 0.7, "label": "fix", **dot},
        {"color": _FAULT, "markersize": 4.0, "label": "fix, faulty", **dot},
        {"color": _TRUTH, "markersize": 7, **dot},
        {"color": _ESTIMATE, "markersize": 5, **dot},
    )
    return [axes.plot([], [], **style)[0] for style in styles]


def _ellipse(covariance: Array) -> Array:
    """(n, 2) outline, east and north [m], that holds 95 in 100 of a normal distribution over north and east."""
    values, axes = np.linalg.eigh(covariance)
    angle = np.linspace(0.0, 2.0 * np.pi, 49)
    circle = np.sqrt(_ELLIPSE * np.maximum(values, 0.0)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outline: Array = (circle @ axes.T)[:, ::-1]
    return outline


def _round_up(length: float) -> float:
    """The next of 1, 2, 5, 10, 20, ..."""
    decade = 10.0 ** math.floor(math.log10(length))
    return next(f * decade for f in (1.0, 2.0, 5.0, 10.0) if f * decade >= length * (1.0 - 1e-9))


def _clock(time: float) -> str:
    return f"{int(time) // 3600}:{int(time) // 60 % 60:02d}:{int(time) % 60:02d}"


def _open_window() -> Any:
    """A figure in a window, or None without a display; a warning says so once."""
    try:
        import matplotlib.pyplot as plt

        figure = plt.figure()
        if figure.canvas.required_interactive_framework is not None:
            figure.show()
            return figure
        plt.close(figure)
    except Exception as error:  # every toolkit has its own kind of error for a display that does not answer
        _log.debug("no window: %r", error)
    _log.warning("there is no display here, so nothing is shown; use render_mode='rgb_array'")
    return None
