"""Paper 001: the GNSS noise estimated on the way, by filters and by graphs (figures only)."""

from __future__ import annotations

from leaderboard.reproduce.paper import Curves, Gain, Method, Paper, Row, Table, Value

__all__ = ["PAPER"]

_SCENARIO = "gnss-noise-step"
_LAG = "the window takes 10 to 20 s to learn of each step, which is most of this score"
_BETTER = (
    "our estimate of the variances is bounded and takes the covariance of the newest state, where the paper's eq. 15 "
    "takes the oldest"
)
_SEEDS = "the paper shows one run; ours is the mean over seeds"
_TABLE_2 = {
    "Sage-Husa filter": (3.65, 3.55),
    "IAE filter": (1.86, 1.65),
    "IAE-FGO-Fix": (1.28, 1.37),
    "IAE-FGO": (1.20, 1.07),
}


def _rows() -> tuple[Row, ...]:
    rows: list[Row] = []
    for method, figures in _TABLE_2.items():
        for axis, figure in zip(("east", "north"), figures, strict=True):
            rows.append(Value(_SCENARIO, method, f"sigma_{axis}_rmse", figure, lower=_BETTER, higher=_LAG))
    for method in ("Sage-Husa filter, fading", "IAE filter, adaptive window"):
        rows += [Value(_SCENARIO, method, f"sigma_{axis}_rmse") for axis in ("east", "north")]
    return tuple(rows)


PAPER = Paper(
    key="001",
    title="GNSS noise estimated from innovations, in a filter and in a graph",
    citation="Mao, Wang and Fu 2025, 'Robust GNSS/INS Integrated Navigation Algorithm Based on Adaptive Factor Graph "
    "Optimization'; Table 2 and Figure 1 (simulation)",
    runs=10,
    full=200,
    methods=(
        Method("Sage-Husa filter", ("sage-husa-paper", "sage-husa:fading=1.0,prior=0")),
        Method("Sage-Husa filter, fading", ("sage-husa",)),
        Method("IAE filter", ("iae-fixed",)),
        Method("IAE filter, adaptive window", ("iae",)),
        Method("IAE-FGO-Fix", ("iae-fgo-fixed", "iae-fgo-fix")),
        Method("IAE-FGO", ("iae-fgo",)),
        Method("EKF", ("ekf",)),
    ),
    tables=(
        Table("RMSE of the estimated GNSS sigma (Table 2)", _rows()),
        Table(
            "Claims",
            (
                *(
                    Gain(
                        _SCENARIO, "IAE filter", "Sage-Husa filter", f"sigma_{axis}_rmse", round(1.0 - iae / sage, 4),
                        derived=True, lower=_SEEDS, higher=_SEEDS,
                    )
                    for axis, iae, sage in (("east", 1.86, 3.65), ("north", 1.65, 3.55))
                ),
                *(
                    Gain(
                        _SCENARIO, "IAE-FGO", "IAE-FGO-Fix", f"sigma_{axis}_rmse", gain, lower=_SEEDS, higher=_SEEDS
                    )
                    for axis, gain in (("east", 0.0625), ("north", 0.2190))
                ),
            ),
        ),
        Table(
            "What it is worth: position (no figures in the paper for the simulation)",
            tuple(
                Value(_SCENARIO, method, "horizontal_rmse")
                for method in ("EKF", "Sage-Husa filter", "Sage-Husa filter, fading", "IAE filter",
                               "IAE filter, adaptive window", "IAE-FGO-Fix", "IAE-FGO")
            ),
        ),
    ),
    curves=(
        Curves(
            "figure-1", "GNSS sigma, estimated and true", _SCENARIO,
            ("Sage-Husa filter", "IAE filter", "IAE-FGO-Fix", "IAE-FGO"),
            {"East sigma [m]": "sigma_east.gnss", "North sigma [m]": "sigma_north.gnss"},
        ),
    ),
    notes=("Tables 1 and 3 of the road test are not here: its data are not public.",),
)  # fmt: skip
