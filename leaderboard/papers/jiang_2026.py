"""Jiang et al. (2026): ships without an INS, in three motions and through two outages of GNSS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from simnav.leaderboard.results.errors import RequestError
from simnav.scenario import Scenario, load
from simnav.sensors.faults import NoiseStep

from .claims.claim import Choice, Claim, Dial, Setting, compared
from .claims.dials import choice_dial, of_rows, scenario_dial, with_keys
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
    Rule,
    Table,
    Value,
)
from .settings import PaperSetting

__all__ = ["CLAIMS", "PAPER"]

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
    "the errors of the paper's filters are those of a filter that stands still in the outage (see its row): in 60 s "
    "the ship makes 390 m at 6.5 m/s. A filter with compass and log drifts by the errors of its estimates of current "
    "and biases"
)
_STANDING = "our ship is slower in these 60 s than 500 m ask for; its speed is our choice"
_CONTRADICTION = (
    "the paper has two figures for the same runs: 0.04 to 0.05 deg in Figure 7, and 0.22 to 0.25 deg in Table 3. No "
    "run can give both. Ours has a compass with 0.5 deg of noise and of bias"
)
_LARGEST = "the noise of GNSS and the motions are our choice, because the paper's tables of them are missing"
_SIGMA_POINTS = "with speed and heading measured the model is almost linear, so EKF and UKF give the same result"
_KNOWN = (
    "the noise is as the datasheet says, so there is little to adapt to. The gain is there if the filter is told a "
    "fifth of the true noise and the network has learned the true one, or if the noise grows for a part of the run "
    "(see the claims)"
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
        Value(scenario, "EKF, standing still", "outage_end_error_max", drift, "at-least", lower=_STANDING),
        *(Value(scenario, m, "outage_end_error_max", 20.0, rule="at-most") for m in ("FGO", "ANFIS-FGO")),
        Value(scenario, "GNSS alone", "outage_end_error_max"),
        *measured(scenario, _METHODS, ("outage_end_error", "horizontal_max")),
    )


def _figures_5_to_7() -> tuple[Row, ...]:
    """The ranges of errors that the text reads from the paper's figures, of one axis: here for both axes together."""
    rows: list[Row] = []
    both = 2.0**0.5
    for scenario in _SCENARIOS.values():
        # "within ±4-6 m", "approximately 6-12 m", "20-25 m" in CM.
        ranges: list[tuple[str, float, float]] = [("ANFIS-FGO", 4.0, 6.0), ("FGO", 6.0, 12.0)]
        if scenario == _CM:
            ranges.append(("EKF", 20.0, 25.0))
        for method, least, most in ranges:
            spread = (round(both * least, 2), round(both * most, 2))
            rows.append(Value(scenario, method, "horizontal_max", spread, derived=True, lower=_LARGEST,
                              higher=_LARGEST))  # fmt: skip
        for method, largest in (("ANFIS-FGO", 0.4), ("FGO", 0.6), ("EKF", 1.2), ("UKF", 1.2)):
            rows.append(Value(scenario, method, "velocity_horizontal_rmse", round(both * largest, 3), "at-most",
                              derived=True, higher=_CURRENT))  # fmt: skip
        for method, degrees in (("ANFIS-FGO", (0.04, 0.05)), ("FGO", (0.05, 0.07)), ("EKF", 0.1), ("UKF", 0.1)):
            rule: Rule = "equal" if isinstance(degrees, tuple) else "at-least"
            rows.append(Value(scenario, method, "heading_mae", degrees, rule, derived=True, lower=_HEADING,
                              higher=_CONTRADICTION))  # fmt: skip
    return tuple(rows)


def _without_outages(scenario: Scenario) -> Scenario:
    return scenario.model_copy(update={"faults": tuple(f for f in scenario.faults if f.kind != "outage")})


def _noisy(scenario: Scenario) -> Scenario:
    """With GNSS noise five times as large as the datasheet says, in two intervals."""
    step = NoiseStep(instruments=("gnss",), factor=5.0, intervals=((250.0, 400.0), (750.0, 900.0)))
    return _without_outages(scenario).model_copy(update={"faults": (step,)})


_set = PaperSetting
_SETTINGS = (
    _set("rate of GNSS [Hz]", "printed", "1 Hz", _OUTAGES, "instruments.gnss.rate_hz"),
    _set("rate of the compass [Hz]", "printed", "1 Hz", _OUTAGES, "instruments.gyrocompass.rate_hz"),
    _set("rate of the log [Hz]", "printed", "1 Hz", _OUTAGES, "instruments.speed_log.rate_hz"),
    _set("number of runs", "printed", "200", ours="up to 200"),
    _set("motions (Table 1)", "ours", "missing from the text at hand",
         ours="ship-straight, ship-turn, ship-dead-reckoning"),
    _set("noise of GNSS (Table 2) [m]", "ours", "missing from the text at hand", _OUTAGES, "instruments.gnss.sigma_m"),
    _set("noise of the compass (Table 2) [deg]", "ours", "missing from the text at hand", _OUTAGES,
         "instruments.gyrocompass.sigma_deg"),
    _set("bias of the compass [deg]", "ours", "", _OUTAGES, "instruments.gyrocompass.bias_deg"),
    _set("noise of the log (Table 2) [m/s]", "ours", "missing from the text at hand", _OUTAGES,
         "instruments.speed_log.sigma_m_s"),
    _set("bias of the log [m/s]", "ours", "", _OUTAGES, "instruments.speed_log.bias_m_s"),
    _set("current [m/s]", "ours", "none is named", _OUTAGES, "current.speed_m_s"),
    _set("states", "printed", "position, speed, heading, biases of log and compass",
         ours="the same, with turn rate and current"),
    _set("CM: outages [s]", "printed", "60 s from 500 s and from 1100 s", ours="the same"),
    _set("field: length [s]", "printed", "1 h", _FIELD_OUTAGES, "duration_s"),
    _set("field: speed at the start [m/s]", "printed", "about 6.5 m/s", _FIELD_OUTAGES, "start.speed_m_s",
         "(6.5 in the mean, with the printed deceleration)"),
    _set("field: course", "printed", "294 to 280 deg", ours="the same"),
    _set("field: deceleration", "printed", "3.4e-4 m/s^2", ours="the same"),
    _set("field: outages [s]", "printed", "60 s from 400 s and from 900 s", ours="the same"),
    _set("network (section 3)", "ours", "missing from the text at hand",
         ours="a reconstruction: 27 rules, trained on simulated voyages"),
    _set("length of the window", "ours", "m, without a figure", ours="20 epochs"),
    _set("what the filters do in an outage", "read from a figure", "errors of 200 to 500 m after 60 s",
         ours="dead reckoning; ship-ekf-standing stands still"),
)  # fmt: skip


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
        Method("EKF, standing still", ("ship-ekf-standing",)),
        Method("UKF", ("ship-ukf",)),
        Method("FGO", ("ship-fgo",)),
        Method("ANFIS-FGO", ("anfis-fgo:level=datasheet",)),
        Method(_MOTION_ALONE, ("anfis-fgo-motion:level=datasheet",)),
        Method("FGO, whole graph", ("ship-fgo-full",)),
    ),
    tables=(
        *(Table(f"{motion} ({scenario})", _accuracy(motion), "Table 3") for motion, scenario in _SCENARIOS.items()),
        Table(
            "Claims of the simulations",
            tuple(
                Gain(s, "ANFIS-FGO", "EKF", score, gain, lower=_KNOWN if score == "horizontal_rmse" else _FILTERS)
                for score, gain in (("horizontal_rmse", 0.35), ("velocity_horizontal_rmse", 0.65))
                for s in _SCENARIOS.values()
            ),
        ),
        Table(
            "Ranges of errors in the figures: position (largest), velocity, heading", _figures_5_to_7(), "Figure 7"
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
        "In these tables ANFIS-FGO takes the noise of the datasheet for granted, as in its training. The row anfis-fgo "
        "also learns the level of the noise, and does not lose where a datasheet is wrong (see the claims). Where a "
        "datasheet is right both give the same.",
        "The paper contradicts itself on the heading error: 0.04 to 0.05 deg in Figure 7, 0.22 to 0.25 deg in Table 3.",
        "Tables 3 and 4 are of runs without outages, as in the paper. So CM and the field run are run without theirs.",
    ),
    settings=_SETTINGS,
    variants={
        _CM: (_OUTAGES, _without_outages),
        _FIELD: (_FIELD_OUTAGES, _without_outages),
        _NOISY: (_OUTAGES, _noisy),
    },
)  # fmt: skip


_NETWORK = (
    "the table of instruments is missing from the text at hand; here the network is told the true noise, as one that "
    "has learned it from such data, and the EKF is not"
)


def _both_told(setting: Setting, value: Choice) -> Setting:
    """Both methods are told the datasheet of ours, and the true noise is larger."""
    keys = {"instruments.gnss.times_datasheet": {"sigma": value}}
    return setting if value == 1.0 else setting.on(with_keys(setting.scenario, "both-told", value, keys))


def _learned(setting: Setting, value: Choice) -> Setting:
    """As `_both_told`, with inputs of the network that are relative to the noise of the last innovations."""
    return _both_told(setting.with_parameters("row", level="learned"), value)


def _than_told(setting: Setting, value: Choice) -> Setting:
    """GNSS with five times the noise of ours, 20 m; the other method is told so many times less."""
    if float(value) <= 0.0:
        raise RequestError(f"told={value:g}: the true noise as a multiple of what the EKF is told should be above 0")
    gnss, sigma = "instruments.gnss", (20.0, 20.0, 40.0)
    right = with_keys(setting.scenario, "sigma", 20.0, {f"{gnss}.sigma_m": list(sigma)})
    if value == 1.0:
        return setting.on(right)
    keys = {f"{gnss}.sigma_m": [s / float(value) for s in sigma], f"{gnss}.times_datasheet": {"sigma": value}}
    return replace(setting, scenario=right, than_scenario=with_keys(right, "told", value, keys))


def _noise_step(factor: float) -> Mapping[str, object]:
    step = {"kind": "noise_step", "instruments": ["gnss"], "start_s": 200.0, "end_s": 400.0, "factor": factor}
    return {"fault": [step]}


def _claim(name: str, run: str, scenario: str, gain: float, words: str) -> Claim:
    told = (1.0, 2.0, 3.0, 5.0)
    return Claim(
        name, PAPER.key, f"in {run} the horizontal error of ANFIS-FGO is {words} % below that of the EKF", gain,
        compared(lambda: PAPER.scenario(scenario), "anfis-fgo:level=datasheet", "ship-ekf", "horizontal_rmse"),
        (
            Dial("told", "the true GNSS noise (20 m), as a multiple of what the EKF is told,", "", told, _than_told,
                 why=_NETWORK),
            Dial("both-told", "the true GNSS noise, as a multiple of what both are told (4 m),", "", told, _both_told,
                 1.0, "for comparison: the network is told the wrong noise as well"),
            Dial("both-told-learned", "the same, with a network that learns the level of the noise", "", told, _learned,
                 why="for comparison: the row anfis-fgo as it is by default, with level=learned"),
            scenario_dial("noise", "the GNSS noise for 200 s of the run, as a multiple of the datasheet's,", "",
                          (1.0, 3.0, 5.0, 10.0), _noise_step, ours=1.0,
                          why="the text says that the noise of its instruments is stable, and prints no size"),
        ),
        derived=words != f"{100.0 * gain:g}",
    )  # fmt: skip


_OUTAGE = Claim(
    "jiang-outage", PAPER.key, "at the end of outages of 60 s (field) the error of FGO is 90 % below that of the EKF",
    0.90, compared(lambda: load(_FIELD_OUTAGES), "ship-fgo", "ship-ekf", "outage_end_error_max"),
    (
        choice_dial(
            "prediction", "the position of the EKF in an outage",
            {"dead reckoning": of_rows(than="ship-ekf"), "stands still": of_rows(than="ship-ekf-standing")},
            ours="dead reckoning",
            why="in the paper EKF and UKF are off by 200 to 400 m, and FGO by at most 20 m; how its filters predict is "
            "not printed",
        ),
    ),
    derived=True,
)  # fmt: skip

CLAIMS = (
    _claim("jiang-turn", "a steady turn (CTM)", "ship-turn", 0.35, "30 to 40"),
    _claim("jiang-straight", "a straight course (CALM)", "ship-straight", 0.35, "30 to 40"),
    _OUTAGE,
)
