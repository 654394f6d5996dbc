"""The common part of all environments that draw the chart of a run."""

from __future__ import annotations

from typing import Any, TypeVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from simnav.environment.rendering import Chart

__all__ = ["ChartedEnv"]

ObservationType = TypeVar("ObservationType")
ActionType = TypeVar("ActionType")


class ChartedEnv(gymnasium.Env[ObservationType, ActionType]):
    """An environment with a chart of its run.

    Parameters
    ----------
    render_mode : {"human", "rgb_array"}, optional
        Show the chart in a window, or return it as an array; default: no chart.

    Raises
    ------
    ValueError
        If the mode is none of these.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(self, render_mode: str | None):
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode is 'human', 'rgb_array' or None, not {render_mode!r}")
        self.render_mode = render_mode
        self._chart: Chart | None = None

    def render(self) -> NDArray[np.uint8] | None:
        """The present chart: an (h, w, 3) array in mode ``rgb_array``; in mode ``human`` the window shows it."""
        if self._chart is None:
            if self.render_mode is None:
                gymnasium.logger.warn("render() shows nothing: make the environment with render_mode='rgb_array'")
                return None
            raise gymnasium.error.ResetNeeded("there is nothing to render yet: call reset() first")
        return self._chart.frame() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window and release the run."""
        if self._chart is not None:
            self._chart.close()
        self._chart = None
        self._forget()

    def _forget(self) -> None:
        """Release the run; subclasses may override it."""

    def _begin_chart(self, title: str, duration: float) -> None:
        """Make an empty chart for a run of ``duration`` seconds, if the environment has a render mode."""
        if self.render_mode is None:
            return
        if self._chart is None:
            self._chart = Chart(title, duration, human=self.render_mode == "human")
        self._chart.clear()
        self._show()

    def _show(self) -> None:
        """Update the window, if there is one."""
        if self._chart is not None and self.render_mode == "human":
            self._chart.show()
