"""Figures of ``simnav paper train-anfis``, membership functions and the learning curve, and of ``simnav tune``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simnav.estimators.adaptations.anfis_file import FEATURES, Parameters
from simnav.estimators.training.hybrid_learning import Learned
from simnav.types import Array

from .frames import legend_below
from .style import GREY, PALETTE, figure, save_as, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["learning_curve", "membership_functions", "objective_curve", "write"]

#: Axis label of each input, and what it is multiplied by.
LABELS: dict[str, tuple[str, float]] = {
    "innovation": ("Whitened innovation, ln(1 + norm)", 1.0),
    "recent_innovations": ("Its fading mean", 1.0),
    "speed": ("Speed [m/s]", 1.0),
    "turn_rate": ("Turn rate [deg/s]", float(np.degrees(1.0))),
    "change_of_speed": ("Change of speed [m/s²]", 1.0),
}
_NAMES = ("low", "medium", "high")


def write(parameters: Parameters, learned: Learned, path: Path) -> list[Path]:
    """Draw both figures as PNG beside a parameter file; OSError where that cannot be."""
    return [
        save_as(membership_functions(parameters, learned), path.with_name(f"{path.stem}-memberships.png")),
        save_as(learning_curve(learned), path.with_name(f"{path.stem}-learning.png")),
    ]


def membership_functions(parameters: Parameters, learned: Learned) -> Figure:
    """Grades of membership over each input's range in training: dashed before, solid after."""
    names = FEATURES[parameters.features]
    u = np.linspace(0.0, 1.0, 301)
    grid: Array = np.repeat(u[:, None], len(names), axis=1)
    before, after = learned.initial.grades(grid), learned.network.grades(grid)
    with styled():
        fig = figure(9.0, 2.9)
        axes = fig.subplots(1, len(names), sharey=True)
        for i, (ax, name) in enumerate(zip(axes, names, strict=True)):
            label, unit = LABELS[name]
            x = unit * (parameters.low[i] + u * (parameters.high[i] - parameters.low[i]))
            for j in reversed(range(after.shape[2])):  # the legend begins with the last
                colour = PALETTE[j % len(PALETTE)][0]
                member = _NAMES[j] if after.shape[2] == len(_NAMES) else str(j + 1)
                ax.plot(x, before[:, i, j], color=colour, ls=(0, (4, 2)), lw=1.0)
                ax.plot(x, after[:, i, j], color=colour, label=member)
            ax.set(xlabel=label, xlim=(x[0], x[-1]), ylim=(0.0, 1.05))
        axes[0].plot([], [], color=GREY, ls=(0, (4, 2)), lw=1.0, label="before training")
        axes[0].set_ylabel("Grade of membership")
        axes[0].set_title(f"ANFIS (reconstruction), features {parameters.features!r}")
        legend_below(fig, axes[0])
    return fig


def objective_curve(objectives: Sequence[float], before: float, title: str) -> Figure:
    """The objective of every evaluation of a search, the best so far, and that of the values before."""
    with styled():
        fig = figure(6.0, 3.2)
        ax = fig.add_subplot()
        count = np.arange(1, len(objectives) + 1)
        ax.plot(count, objectives, color=PALETTE[4][0], marker=".", ls="", label="evaluations")
        ax.plot(count, np.minimum.accumulate(objectives), color=PALETTE[0][0], label="best so far")
        ax.axhline(before, color=GREY, lw=0.8, ls=(0, (1.2, 1.2)), label="before")
        ax.set(xlabel="Evaluation", ylabel="Mean log ratio of errors", title=title)
        legend_below(fig, ax)
    return fig


def learning_curve(learned: Learned) -> Figure:
    """Error of training and validation by pass."""
    with styled():
        fig = figure(6.0, 3.2)
        ax = fig.add_subplot()
        passes = np.arange(1, len(learned.training) + 1)
        ax.plot(passes, learned.training, color=PALETTE[0][0], marker=".", label="training")
        ax.plot(passes, learned.validation, color=PALETTE[1][0], marker=".", label="validation")
        ax.axvline(learned.best + 1, color=GREY, lw=0.8, ls=(0, (1.2, 1.2)), label="kept")
        ax.set(xlabel="Pass", ylabel="RMSE of ln(variance / datasheet's)")
        ax.set_title("ANFIS (reconstruction): hybrid learning")
        legend_below(fig, ax)
    return fig
