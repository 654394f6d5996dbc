"""Mao, Wang and Fu (2025): the noise of GNSS, estimated from innovations in filters and in factor graphs."""

from __future__ import annotations

from .declarations import PHOTOGRAPH, drawings, measured
from .paper import POSITION, Figure, Gain, Method, NotShown, Paper, Row, Table, Value

__all__ = ["PAPER"]

_SCENARIO, _ROAD = "gnss-noise-step", "car-road"
_LAG = "the window needs 10 to 20 s to follow each step of the noise, and most of this error arises in that time"
_BETTER = (
    "our estimate of the variances is bounded and uses the covariance of the newest state, whereas the paper's eq. 15 "
    "uses that of the oldest state"
)
_SEEDS = "the paper shows one run; ours is the mean over many runs"
_OTHER_ROAD = "our drive is another one, with faults of our choice"
_INNOVATIONS = (
    "with the IMU of this drive the prediction is less certain than a fix. An innovation then says little about the "
    "noise of the fixes, and IAE keeps the datasheet's noise. Without this rule IAE would attribute the errors of the "
    "IMU to the fixes"
)
_SAME_INNOVATIONS = (
    "the newest state of a window predicts the next fix as a filter does. The innovations are the same, and so are the "
    "estimates of the noise. Most of the error arises in the 10 to 20 s after each step"
)
_LENGTH = "the length of the window changes the delay at each step by a few seconds only; the paper shows one run"
_SAME = "with the same states and noise a window gains nothing over a well linearised filter"
_TABLE_2 = {
    "Sage-Husa filter": (3.65, 3.55),
    "IAE filter": (1.86, 1.65),
    "IAE-FGO-Fix": (1.28, 1.37),
    "IAE-FGO": (1.20, 1.07),
}
_VARIANTS = ("Sage-Husa filter, fading", "IAE filter, adaptive window")


def _rows() -> tuple[Row, ...]:
    rows: list[Row] = []
    for method, figures in _TABLE_2.items():
        for axis, figure in zip(("east", "north"), figures, strict=True):
            late = _SAME_INNOVATIONS if "FGO" in method else _LAG
            rows.append(Value(_SCENARIO, method, f"sigma_{axis}_rmse", figure, lower=_BETTER, higher=late))
    return (*rows, *measured(_SCENARIO, _VARIANTS, ("sigma_east_rmse", "sigma_north_rmse")))


def _claims() -> tuple[Row, ...]:
    """Gains in the estimated sigma: two follow from Table 2, the third is printed."""
    rows: list[Row] = []
    for method, than, lower in (
        ("IAE filter", "Sage-Husa filter", _SEEDS),
        ("IAE-FGO-Fix", "IAE filter", _SAME_INNOVATIONS),
    ):
        for axis, a, b in zip(("east", "north"), _TABLE_2[method], _TABLE_2[than], strict=True):
            gain = round(1.0 - a / b, 4)
            rows.append(Gain(_SCENARIO, method, than, f"sigma_{axis}_rmse", gain, derived=True, lower=lower,
                             higher=_SEEDS))  # fmt: skip
    for axis, gain in (("east", 0.0625), ("north", 0.2190)):
        rows.append(Gain(_SCENARIO, "IAE-FGO", "IAE-FGO-Fix", f"sigma_{axis}_rmse", gain, lower=_LENGTH, higher=_SEEDS))
    return tuple(rows)


# Mean, largest and RMS error north, east, down [m].
_TABLE_3 = {
    "EKF": ((0.75, 2.59, 0.96), (0.55, 2.39, 0.74), (0.75, 1.55, 0.75)),
    "FGO": ((0.62, 2.19, 0.77), (0.51, 2.04, 0.65), (0.63, 1.66, 0.73)),
    "Huber-FGO": ((0.56, 2.06, 0.68), (0.46, 1.96, 0.55), (0.60, 1.58, 0.70)),
    "IAE-FGO": ((0.43, 1.62, 0.56), (0.38, 1.66, 0.48), (0.54, 1.43, 0.66)),
}
_AXES = ("north", "east", "vertical")


def _road() -> tuple[Row, ...]:
    return tuple(
        Value(_ROAD, method, f"{axis}_{statistic}", figure, rule="beside")
        for method, rows in _TABLE_3.items()
        for axis, figures in zip(_AXES, rows, strict=True)
        for statistic, figure in zip(("mae", "max", "rmse"), figures, strict=True)
    )


def _road_claims() -> tuple[Row, ...]:
    rows: list[Row] = []
    for axis, printed, column in zip(_AXES, (0.1764, 0.1273, 0.0571), range(3), strict=True):
        rms = {method: figures[column][2] for method, figures in _TABLE_3.items()}
        rows += [
            Gain(_ROAD, "IAE-FGO", "Huber-FGO", f"{axis}_rmse", printed, lower=_INNOVATIONS, higher=_OTHER_ROAD),
            *(
                Gain(_ROAD, a, b, f"{axis}_rmse", round(1.0 - rms[a] / rms[b], 4), derived=True, lower=why,
                     higher=_OTHER_ROAD)
                for a, b, why in (("IAE-FGO", "EKF", _INNOVATIONS), ("Huber-FGO", "FGO", _OTHER_ROAD),
                                  ("FGO", "EKF", _SAME))
            ),
        ]  # fmt: skip
    return tuple(rows)


PAPER = Paper(
    key="mao-2025",
    authors="G. Mao, K. Wang and T. Fu",
    short="Mao, Wang and Fu (2025)",
    title="Robust GNSS/INS integrated navigation algorithm based on adaptive factor graph optimization",
    published="Manuscript of 2 December 2025",
    doi="",
    about="a vehicle with INS and GNSS: the GNSS noise estimated from innovations",
    runs=10,
    full=200,
    methods=(
        Method("Sage-Husa filter", ("sage-husa-paper", "sage-husa:fading=1.0,prior=0")),
        Method("Sage-Husa filter, fading", ("sage-husa",)),
        Method("IAE filter", ("iae-fixed",)),
        Method("IAE filter, adaptive window", ("iae",)),
        Method("IAE-FGO-Fix", ("iae-fgo-fixed",)),
        Method("IAE-FGO", ("iae-fgo",)),
        Method("EKF", ("ekf",)),
        Method("FGO", ("sw-fgo",)),
        Method("Huber-FGO", ("huber-fgo",)),
    ),
    tables=(
        Table("RMSE of the estimated GNSS sigma (simulation)", _rows(), "Table 2"),
        Table("Claims of the simulation", _claims()),
        Table(
            "Position errors in the simulation (the paper has no such figures)",
            measured(
                _SCENARIO,
                ("EKF", "Sage-Husa filter", "IAE filter", *_VARIANTS, "FGO", "Huber-FGO", "IAE-FGO-Fix", "IAE-FGO"),
                ("horizontal_rmse",),
            ),
        ),
        Table("Position errors on the road", _road(), "Table 3"),
        Table("Claims of the road test", _road_claims()),
    ),
    figures=(
        Figure("Figure 1", "GNSS sigma, estimated and true", "run", _SCENARIO, tuple(_TABLE_2),
               {"East sigma [m]": "sigma_east.gnss", "North sigma [m]": "sigma_north.gnss"}),
        Figure("Figure 4", "Trajectories on the road", "track", _ROAD, tuple(_TABLE_3)),
        Figure("Figure 5", "Position errors on the road", "run", _ROAD, tuple(_TABLE_3), POSITION),
        Figure("", "RMSE of the estimated GNSS sigma", "bars", _SCENARIO,
               ("Sage-Husa filter", "IAE filter", *_VARIANTS, "IAE-FGO-Fix", "IAE-FGO"),
               {"East sigma, RMSE [m]": "sigma_east_rmse", "North sigma, RMSE [m]": "sigma_north_rmse"}),
        Figure("", "Distribution of the position error in the simulation", "distribution", _SCENARIO,
               ("EKF", "FGO", "Huber-FGO", "IAE filter", "IAE-FGO-Fix", "IAE-FGO")),
    ),
    not_shown=(
        NotShown("Table 1", "The simulated IMU", "settings and not results; the scenario gnss-noise-step has them"),
        *drawings({"Figure 2": "The vehicle and its instruments", "Figure 3": "The road test's surroundings"},
                  PHOTOGRAPH),
    ),
    notes=(
        "The data of the road test are not public. car-road is another real drive (KITTI), and its noise changes "
        "twice. Its errors stand beside the paper's without a verdict; only the claims of improvement have one.",
    ),
)  # fmt: skip
