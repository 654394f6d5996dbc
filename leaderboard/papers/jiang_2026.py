"""Jiang et al. (2026): ships without an INS, in three motions and through two outages of GNSS."""

from __future__ import annotations

from simnav.scenario import Scenario
from simnav.sensors.faults import NoiseStep

from .declarations import drawings, error_figures, measured
from .paper import (
    HORIZONTAL,
    HORIZONTAL_VELOCITY,
    Figure,
    Gain,
    Method,
    NotShown,
    Paper,
    Row,
    Table,
    Value,
)

__all__ = ["PAPER"]

_OUTAGES, _FIELD_OUTAGES = "ship-dead-reckoning", "ship-field"
_CM, _FIELD, _NOISY = "ship-dead-reckoning-no-outage", "ship-field-no-outage", "ship-dead-reckoning-noisy"
_SCENARIOS = {"CALM": "ship-straight", "CTM": "ship-turn", "CM": _CM}
_METHODS = ("GNSS alone", "EKF", "UKF", "FGO", "ANFIS-FGO")
_MOTION_ALONE = "ANFIS-FGO, motion alone"
_FILTERS = (
    "the paper's filters have a model with five states and fixed noise. Ours estimate the current and the biases. The "
    "GNSS noise of the paper's Table 2 is not known; ours is 4 m for each component"
)
_HEADING = "the noise of the paper's compass is not known; ours has 0.5 deg of noise and of bias, which is estimated"
_CURRENT = "a log measures the speed through the water. Our ship sails in a current of 0.25 m/s; the paper names none"
_DEAD_RECKONING = (
    "the errors of the paper's filters are as large as without dead reckoning: 500 m in 60 s at 6.5 m/s, in which the "
    "ship makes 390 m. A filter with compass and log drifts by the errors of its estimates of current and biases"
)
_SIGMA_POINTS = "with speed and heading measured the model is almost linear, so EKF and UKF give the same result"
_KNOWN = (
    "the noise is as the datasheet says, also in the paper, so there is little to adapt to. The paper's filters do not "
    "estimate the current and the biases"
)
_PRESENT = "a network that sees only the newest innovation cannot tell an interval of larger noise from chance"
_NOISIER = "the gain depends on how much the noise grows, which is our choice"
_FAST = (
    "the gain depends on the length of the run and on the solver. Ours is block-tridiagonal, and its time for the "
    "whole graph grows only in proportion to the length of the run"
)


def _accuracy(motion: str) -> tuple[Row, ...]:
    scenario, rows = _SCENARIOS[motion], list[Row]()
    for method in _METHODS:
        ours = method == "ANFIS-FGO"
        filters = method in ("EKF", "UKF")
        # From the text: ANFIS-FGO 2.7-3.4 m (MAE) and 3.0-3.9 m (RMSE), 0.22-0.35 m/s, 0.22-0.25 and 0.41-0.50 deg. The
        # filters are often above 4-6 m; velocity errors 60-70 % larger (0.35 / 0.3), heading errors twice as large.
        mae = (2.7, 3.4) if ours else None
        rmse = (3.0, 3.9) if ours else (4.0, 6.0) if filters else None
        for axis in ("east", "north"):
            rows.append(Value(scenario, method, f"{axis}_mae", mae, derived=True, lower=_FILTERS, higher=_FILTERS))
            rows.append(Value(scenario, method, f"{axis}_rmse", rmse, derived=True, lower=_FILTERS, higher=_FILTERS))
        speed = (0.22, 0.35) if ours else (0.55, 1.17) if method == "EKF" else None
        if method == "GNSS alone":
            continue
        rows.append(Value(scenario, method, "velocity_horizontal_rmse", speed, derived=True,
                          lower=_FILTERS, higher=_CURRENT))  # fmt: skip
        mae = (0.22, 0.25) if ours else (0.44, 0.50) if filters else None
        rmse = (0.41, 0.50) if ours else (0.82, 1.00) if filters else None
        rows.append(Value(scenario, method, "heading_mae", mae, derived=True, lower=_HEADING, higher=_HEADING))
        rows.append(Value(scenario, method, "heading_rmse", rmse, derived=True, lower=_HEADING, higher=_HEADING))
    return tuple(rows)


def _outages(scenario: str, drift: float) -> tuple[Row, ...]:
    return (
        *(
            Value(scenario, m, "outage_end_error_max", drift, rule="at-least", lower=_DEAD_RECKONING)
            for m in ("EKF", "UKF")
        ),
        *(Value(scenario, m, "outage_end_error_max", 20.0, rule="at-most") for m in ("FGO", "ANFIS-FGO")),
        Value(scenario, "GNSS alone", "outage_end_error_max"),
        *measured(scenario, _METHODS, ("outage_end_error", "horizontal_max")),
    )


def _without_outages(scenario: Scenario) -> Scenario:
    return scenario.model_copy(update={"faults": tuple(f for f in scenario.faults if f.kind != "outage")})


def _noisy(scenario: Scenario) -> Scenario:
    """With GNSS noise five times as large as the datasheet says, in two intervals."""
    step = NoiseStep(instruments=("gnss",), factor=5.0, intervals=((250.0, 400.0), (750.0, 900.0)))
    return _without_outages(scenario).model_copy(update={"faults": (step,)})


PAPER = Paper(
    key="jiang-2026",
    authors="Jiang et al.",
    short="Jiang et al. (2026)",
    title="An improved factor graph optimization algorithm enhanced with ANFIS for ship GNSS/DR integrated navigation",
    published="Journal of Marine Science and Engineering 14(5), 472, 2026",
    doi="10.3390/jmse14050472",
    about="a ship without an INS, with GNSS, compass and log: factor graphs with a neuro-fuzzy noise model",
    runs=10,
    full=200,
    methods=(
        Method("GNSS alone", ("gnss-only",)),
        Method("EKF", ("ship-ekf",)),
        Method("UKF", ("ship-ukf",)),
        Method("FGO", ("ship-fgo",)),
        Method("ANFIS-FGO", ("anfis-fgo",)),
        Method(_MOTION_ALONE, ("anfis-fgo-motion",)),
        Method("FGO, whole graph", ("ship-fgo-full",)),
    ),
    tables=(
        *(Table(f"{motion} ({scenario})", _accuracy(motion), "Table 3") for motion, scenario in _SCENARIOS.items()),
        Table(
            "Claims of the simulations",
            tuple(
                Gain(s, "ANFIS-FGO", "EKF", score, gain, lower=_KNOWN)
                for score, gain in (("horizontal_rmse", 0.35), ("velocity_horizontal_rmse", 0.65))
                for s in _SCENARIOS.values()
            ),
        ),
        Table(
            "The field run: gains in position",
            (
                *(
                    Gain(_FIELD, "ANFIS-FGO", than, "horizontal_rmse", gain, lower=_KNOWN)
                    for than, gain in (("EKF", 0.30), ("UKF", 0.25), ("FGO", 0.10))
                ),
                Gain(_FIELD, "UKF", "EKF", "horizontal_rmse", 0.067, derived=True, lower=_SIGMA_POINTS),
                *measured(_FIELD, (*_METHODS, _MOTION_ALONE), ("east_rmse", "north_rmse", "horizontal_rmse")),
            ),
            "Table 4",
        ),
        Table(
            "Outages of 60 s at 500 s and 1100 s (CM): horizontal error at the end",
            _outages(_OUTAGES, 500.0),
            "Figure 14",
        ),
        Table(
            "Outages of 60 s at 400 s and 900 s (field): horizontal error at the end",
            _outages(_FIELD_OUTAGES, 200.0),
            "Figure 15",
        ),
        Table(
            "Beyond the paper: CM with GNSS noise five times as large in two intervals of 150 s",
            (
                *(
                    Gain(_NOISY, "ANFIS-FGO", than, "horizontal_rmse", gain, derived=True, lower=_PRESENT,
                         higher=_NOISIER)
                    for than, gain in (("EKF", 0.30), ("FGO", 0.10))
                ),
                *measured(_NOISY, (*_METHODS, _MOTION_ALONE), ("horizontal_rmse",)),
            ),
        ),
        Table(
            "Cost: sliding window against the whole graph (CM with outages)",
            (
                Gain(_OUTAGES, "FGO", "FGO, whole graph", "update_mean", 0.9376, lower=_FAST, higher=_FAST),
                *measured(_OUTAGES, ("FGO", "FGO, whole graph", "ANFIS-FGO"), ("update_mean", "horizontal_rmse")),
            ),
            "Figure 13",
        ),
    ),
    figures=(
        *(
            figure
            for motion, scenario in _SCENARIOS.items()
            for figure in error_figures(
                scenario,
                _METHODS[1:],
                {
                    "Figure 5": ("Position errors", HORIZONTAL),
                    "Figure 6": ("Velocity errors", HORIZONTAL_VELOCITY),
                    "Figure 7": ("Heading error", {"Heading error [deg]": "heading"}),
                },
                motion,
            )
        ),
        *(
            Figure("", "Errors over time", "spread", scenario, _METHODS,
                   {"Horizontal error [m]": "horizontal", "Velocity error [m/s]": "velocity"}, motion)
            for motion, scenario in _SCENARIOS.items()
        ),
        Figure("Figure 9", "The route of the field run", "track", _FIELD, ()),
        Figure("Figure 10", "Trajectories of the field run", "track", _FIELD, _METHODS[1:]),
        Figure("Figure 11", "Position errors of the field run", "run", _FIELD, _METHODS[1:],
               {**HORIZONTAL, "Horizontal error [m]": "horizontal"}),
        Figure("Figure 13", "Time per epoch, sliding window and whole graph", "bars", _OUTAGES,
               ("FGO", "FGO, whole graph"), {"Time per epoch [ms]": "update_mean"}),
        *(
            Figure(number, f"Horizontal error through the outages of {run}", "spread", scenario, _METHODS,
                   {"Horizontal error [m]": "horizontal"})
            for number, run, scenario in (
                ("Figure 14", "CM", _OUTAGES), ("Figure 15", "the field run", _FIELD_OUTAGES)
            )
        ),
    ),
    not_shown=(
        *(
            NotShown(number, what, "settings; they are missing from the text at hand, and the scenarios have ours")
            for number, what in (("Table 1", "The three motions"), ("Table 2", "Instruments"))
        ),
        *drawings({"Figure 1": "The factor graph"}),
        *drawings({f"Figure {k}": "A figure of section 3, the neuro-fuzzy network" for k in (2, 3, 4)},
                  "section 3 is missing from the text at hand"),
        *drawings({"Figure 8": "The ship"}, "a photograph"),
        NotShown("Figure 12", "Share of the processor",
                 "it shows how many threads a solver uses on one computer; ours use one thread, and their time is in "
                 "Figure 13"),
    ),
    notes=(
        "The paper's tables of motions, instruments and results are missing from the text at hand. Its figures here "
        "are the ranges of its text, and figures that follow from them.",
        "ANFIS-FGO is a reconstruction, because the section that defines the network is missing as well. The field "
        "data are not public; ship-field is a simulated run with the same length, speeds, courses and outages.",
        "Tables 3 and 4 are of runs without outages, as in the paper. So CM and the field run are run without theirs.",
    ),
    variants={
        _CM: (_OUTAGES, _without_outages),
        _FIELD: (_FIELD_OUTAGES, _without_outages),
        _NOISY: (_OUTAGES, _noisy),
    },
)  # fmt: skip
