"""Guo et al. (2026): KF, EKF, UKF and two sliding-window graphs on a ship with INS, GNSS and DVL."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from simnav.scenario import load

from .claims.claim import Choice, Claim, Dial, Setting, compared
from .claims.dials import lag_dial, scenario_dial
from .declarations import drawings, error_figures, measured
from .paper import (
    ATTITUDE,
    POSITION,
    VELOCITY,
    Figure,
    Gain,
    Method,
    NotShown,
    Paper,
    Row,
    Table,
    Value,
)
from .settings import setting_of

__all__ = ["CLAIMS", "PAPER"]

_SCENARIO, _BIAS = "coastal-voyage", "window-bias"
_COST = "the two figures come from different computers and programming languages"
_OPEN_LOOP = (
    "this KF is in open loop, so that its inertial navigation is never corrected. With gyros of 3 deg/h its error "
    "leaves the range of the linear model within 100 minutes"
)
_STATES = "this UKF has 15 states, among them the biases of the IMU. The paper's filters have nine states and no biases"
_MEMORY = "our figure includes the libraries and the record of the run, which are the same for all methods"
_VELOCITY = "the nine-state model has no IMU biases, and the paper's model has a DVL sigma of 0.1 m/s"
_DISTURBED = "the sea trial is not public: the size of the GNSS errors near the shore is our choice"
_WINDOW = (
    "of the newest state a window gains nothing over a filter with the same states. The gain is there if the errors of "
    "the window are those of an older node (see the claims)"
)
_AXES = (
    "the paper prints no errors of its fixes by axis. Ours have multipath of 4, 4 and 6 m (north, east, down). With 3, "
    "6 and 1 m, and white noise that is as large down as across, it holds for EKF and GA-FGO on four of four seeds"
)
_LINEAR = (
    "both filters have the same states, and for errors of this size the model is almost linear, so both give the same "
    "result"
)

# Method -> estimators with the same states and noise: EKF, SW-FGO, and GA-FGO with printed and whitened weights.
_MODELS = {
    "9 states": ("ekf-9", "sw-fgo-paper", "ga-fgo-paper", "ga-fgo-paper:preset=default"),
    "9 states, datasheet noise": tuple(
        f"{name}sigma_gnss_horizontal=0,sigma_gnss_vertical=0,sigma_dvl=0"
        for name in ("ekf-9:", "sw-fgo-paper:", "ga-fgo-paper:", "ga-fgo-paper:preset=default,")
    ),
    "15 states": ("ekf", "sw-fgo", "ga-fgo:preset=paper", "ga-fgo"),
}
_ROLES = ("EKF", "SW-FGO", "GA-FGO, printed weights", "GA-FGO, whitened weights")
# The paper's methods and our main alternatives have shorter names.
_SHORT = {
    "EKF, 9 states": "EKF",
    "SW-FGO, 9 states": "SW-FGO",
    "GA-FGO, printed weights, 9 states": "GA-FGO",
    "GA-FGO, whitened weights, 15 states": "GA-FGO, 15 states",
}
_FACTORS = {(role, model): _SHORT.get(f"{role}, {model}", f"{role}, {model}") for model in _MODELS for role in _ROLES}

_FOUR = ("EKF", "UKF", "SW-FGO", "GA-FGO")
_ALL = (
    "KF",
    "EKF",
    "EKF, 15 states",
    "UKF",
    "UKF, 15 states",
    "SW-FGO",
    "SW-FGO, 15 states",
    "GA-FGO",
    "GA-FGO, 15 states",
)
_RIVALS = ("EKF, 15 states", "SW-FGO, 15 states", "GA-FGO, 15 states", "Huber", "Tukey", "DCS", "GNC")


def _effects() -> tuple[Row, ...]:
    """The effect of the weights, for each model; then the effect of the model, for each kind of weights."""
    weights = tuple(
        Gain(_SCENARIO, _FACTORS[role, model], _FACTORS["SW-FGO", model], "position_rmse")
        for role in _ROLES[2:]
        for model in _MODELS
    )
    first, noise, states = _MODELS
    models = tuple(
        Gain(_SCENARIO, _FACTORS[role, b], _FACTORS[role, a], "position_rmse")
        for role in _ROLES[1:]
        for a, b in ((first, noise), (noise, states))
    )
    return (*weights, *models, *measured(_SCENARIO, _FACTORS.values(), ("position_rmse",)))


def _gain(method: str, than: str, paper: float, *, derived: bool = False, lower: str = _WINDOW) -> Gain:
    return Gain(_SCENARIO, method, than, "position_rmse", paper, derived=derived, lower=lower, higher=_DISTURBED)


def _position(method: str, paper: float, **how: str | bool) -> Value:
    return Value(_SCENARIO, method, "position_rmse", paper, **{"lower": _DISTURBED, "higher": _DISTURBED, **how})  # type: ignore[arg-type]


_set = partial(setting_of, _SCENARIO)
_SETTINGS = (
    _set("length [s]", "printed", "6000 s", "duration_s"),
    _set("rate of the IMU [Hz]", "printed", "100 Hz", "instruments.imu.rate_hz"),
    _set("accelerometer bias, in the run [ug]", "printed", "0.005 mg",
         "instruments.imu.accelerometer.bias_instability_ug"),
    _set("gyroscope bias, in the run [deg/h]", "ours", "1 of an unreadable unit",
         "instruments.imu.gyroscope.bias_instability_deg_h"),
    _set("accelerometer bias, turn-on [ug]", "ours", "", "instruments.imu.accelerometer.bias_ug"),
    _set("gyroscope bias, turn-on [deg/h]", "ours", "", "instruments.imu.gyroscope.bias_deg_h"),
    _set("velocity random walk [ug/sqrt(Hz)]", "ours", "", "instruments.imu.accelerometer.random_walk_ug_sqrt_hz"),
    _set("angular random walk [deg/sqrt(h)]", "ours", "", "instruments.imu.gyroscope.random_walk_deg_sqrt_h"),
    _set("rate of GNSS [Hz]", "printed", "1 Hz", "instruments.gnss.rate_hz"),
    _set("noise of GNSS, north, east, down [m]", "printed", "2.5 m CEP, which is 2.12 m for each component",
         "instruments.gnss.sigma_m", "(the vertical is ours)"),
    _set("noise of GNSS that the methods assume [m]", "printed", "2.5, 2.5, 5.0 m", "",
         "2.5, 2.5, 5.0 (sigma_gnss_horizontal, sigma_gnss_vertical)"),
    _set("rate of the DVL [Hz]", "printed", "1 Hz", "instruments.dvl.rate_hz"),
    _set("noise of the DVL [m/s]", "printed", "0.008 m/s (table)", "instruments.dvl.sigma_m_s"),
    _set("noise of the DVL that the methods assume [m/s]", "printed", "0.1 m/s (model)", "", "0.1 (sigma_dvl)"),
    _set("altitudes of the DVL [m]", "printed", "up to 200 m", "instruments.dvl.maximum_altitude_m"),
    _set("the GNSS is degraded from [s]", "printed", "3200 s", "fault[0].start_s"),
    _set("the GNSS is degraded until [s]", "printed", "4800 s", "fault[0].end_s"),
    _set("noise of the degraded GNSS, as a multiple", "ours", "", "fault[0].factor"),
    _set("multipath of the degraded GNSS, north, east, down [m]", "ours", "", "fault[1].sigma_m"),
    _set("share of gross errors of the degraded GNSS", "ours", "", "fault[2].probability"),
    _set("share of gross errors of the DVL", "ours", "", "fault[3].probability"),
    _set("convergence threshold; largest number of iterations", "printed", "1e-6; 10", "", "1e-6; 10"),
    _set("a, c and least weight of GA-FGO (motion, GNSS, DVL)", "printed", "2, 3, 2; 1, 1.5, 1; 0.3, 0.5, 0.3", "",
         "as printed in ga-fgo-paper"),
    _set("length of the window", "ours", "", "", "20 epochs; 61 where an older node is read"),
    _set("sigmas of the motion factor in a second", "ours", "", "", "0.01 m, 0.02 m/s, 0.01 deg"),
    _set("points and weights of the UKF", "ours", "", "", "the scaled unscented transform"),
    _set("feedback of the KF", "ours", "", "", "once a second (kf-9)"),
    _set("track, sea, current, initial errors", "ours", "a figure of the track, without figures", "",
         "those of coastal-voyage"),
)  # fmt: skip


PAPER = Paper(
    key="guo-2026",
    authors="M. Guo, B. Wang, L. Wei, M. Zhang, C. Zhang and H. Lu",
    short="Guo et al. (2026)",
    title="Robust INS/GNSS/DVL integrated navigation for MASS based on gradient-adaptive factor graph optimization",
    published="Preprints 2026 (compared here); Electronics 15(3), 634, 2026",
    doi="10.20944/preprints202601.1976.v1",
    about="a ship with INS, GNSS and DVL: Kalman filters and gradient-adaptive factor graphs",
    runs=6,
    full=50,
    methods=(
        Method("KF", ("kf-9",)),
        Method("KF, open loop, 15 states", ("kf",)),
        Method("UKF", ("ukf-9",)),
        Method("UKF, 15 states", ("ukf",)),
        *(
            Method(_FACTORS[role, model], (row,))
            for model, rows in _MODELS.items()
            for role, row in zip(_ROLES, rows, strict=True)
        ),
        Method("Huber", ("huber-fgo",)),
        Method("Tukey", ("tukey-fgo",)),
        Method("DCS", ("dcs-fgo",)),
        Method("GNC", ("gnc-fgo",)),
    ),
    tables=(
        Table(
            "Position RMSE",
            (
                _position("KF", 3.84),
                _position("EKF", 3.86),
                _position("UKF", 3.70, derived=True),
                _position("SW-FGO", 3.33, derived=True),
                _position("GA-FGO", 3.26),
                *(
                    row
                    for method in ("EKF", "SW-FGO", "GA-FGO")
                    for row in (
                        Value(_SCENARIO, method, "east_over_north", 1.0, rule="at-least", derived=True, lower=_AXES),
                        Value(_SCENARIO, method, "down_over_horizontal", 1.0, rule="at-most", derived=True,
                              higher=_AXES),
                    )
                ),
                *measured(
                    _SCENARIO,
                    ("EKF, 15 states", "UKF, 15 states", "SW-FGO, 15 states", "GA-FGO, 15 states"),
                    ("position_rmse",),
                ),
                Value(_SCENARIO, "KF, open loop, 15 states", "position_rmse", higher=_OPEN_LOOP),
            ),
            "Figure 7",
        ),
        Table(
            "Gain of GA-FGO, and the gains of other methods that follow",
            (
                _gain("GA-FGO", "KF", 0.151),
                _gain("GA-FGO", "EKF", 0.156),
                _gain("GA-FGO", "UKF", 0.120),
                _gain("GA-FGO", "SW-FGO", 0.021),
                Gain(_SCENARIO, "SW-FGO", "EKF", "position_rmse", 0.1373, derived=True, lower=_WINDOW),
                Gain(_SCENARIO, "KF", "EKF", "position_rmse", 0.005, derived=True, lower=_LINEAR),
                _gain("UKF", "EKF", 0.0415, derived=True, lower=_LINEAR),
                _gain("UKF, 15 states", "EKF, 15 states", 0.0415, derived=True, lower=_LINEAR),
                _gain("GA-FGO, 15 states", "EKF, 15 states", 0.156, derived=True),
                _gain("GA-FGO, 15 states", "UKF, 15 states", 0.120, derived=True),
                _gain("GA-FGO, 15 states", "SW-FGO, 15 states", 0.021, derived=True),
            ),
            "Figure 11",
        ),
        Table("Beyond the paper: the effects of weights, measurement noise and states", _effects()),
        Table(
            "Statements of the text on the error curves",
            (
                *(
                    Value(_SCENARIO, m, score, bound, rule="at-least", lower=_DISTURBED)
                    for score, bound in (("north_max", 8.0), ("east_max", 8.0), ("horizontal_max", 10.0))
                    for m in ("EKF", "UKF")
                ),
                *(
                    Value(_SCENARIO, m, f"velocity_{axis}_rmse", 0.05, rule="at-most", derived=True, higher=_VELOCITY)
                    for m in ("GA-FGO", "GA-FGO, 15 states")
                    for axis in ("north", "east", "vertical")
                ),
                *measured(_SCENARIO, _ALL, ("velocity_horizontal_rmse", "level_rmse", "heading_rmse")),
            ),
        ),
        Table(
            "Beyond the paper: a GNSS bias of 25 m for 100 s, longer than any window",
            measured(_BIAS, _RIVALS, ("horizontal_rmse", "horizontal_max")),
        ),
        Table(
            "Cost of an epoch",
            (
                *(
                    Value(_SCENARIO, m, score, bound, rule="at-most", higher=why)
                    for score, why, bounds in (
                        ("update_mean", _COST, (8.2, 15.6, 11.8, 12.3)),
                        ("peak_memory", _MEMORY, (12.0, 18.0, 42.0, 45.0)),
                    )
                    for m, bound in zip(
                        ("EKF, 15 states", "UKF, 15 states", "SW-FGO, 15 states", "GA-FGO, 15 states"),
                        bounds,
                        strict=True,
                    )
                ),
                *measured(_SCENARIO, ("EKF", "SW-FGO", "GA-FGO"), ("update_mean", "peak_memory")),
            ),
            "Table 3",
        ),
    ),
    figures=(
        Figure("Figure 3", "Trajectories", "track", _SCENARIO, _FOUR),
        *error_figures(
            _SCENARIO,
            _FOUR,
            {
                "Figure 4": ("Position errors", POSITION),
                "Figure 5": ("Velocity errors", VELOCITY),
                "Figure 6": ("Attitude errors", ATTITUDE),
            },
        ),
        Figure("Figure 7", "Position RMSE, total and by axis", "bars", _SCENARIO, _ALL,
               {"Position [m]": "position_rmse", "North [m]": "north_rmse", "East [m]": "east_rmse",
                "Down [m]": "vertical_rmse"}),
        Figure("Figure 8", "Error magnitudes", "run", _SCENARIO, _FOUR,
               {"Position error [m]": "position", "Velocity error [m/s]": "velocity",
                "Attitude error [deg]": "attitude"}),
        Figure("Figure 8", "Error magnitudes", "spread", _SCENARIO, _ALL,
               {"Horizontal error [m]": "horizontal", "Velocity error [m/s]": "velocity",
                "Heading error [deg]": "heading"}, "all runs"),
        Figure("Figure 9", "Normalised residuals of the factors of GA-FGO", "run", _SCENARIO,
               ("GA-FGO", "GA-FGO, 15 states"),
               {"Motion": "residual.motion", "GNSS": "residual.gnss", "DVL": "residual.dvl"}),
        Figure("Figure 10", "Weights of the factors of GA-FGO", "run", _SCENARIO, ("GA-FGO", "GA-FGO, 15 states"),
               {"Motion": "weight.motion", "GNSS": "weight.gnss", "DVL": "weight.dvl"}),
        Figure("Figure 11", "Gain of GA-FGO", "gains", _SCENARIO, ("GA-FGO", "KF", "EKF", "UKF", "SW-FGO"),
               {"Gain in position RMSE [%]": "position_rmse"}, "a"),
        Figure("Figure 11", "Gain of GA-FGO", "gains", _SCENARIO,
               ("GA-FGO, 15 states", "EKF, 15 states", "UKF, 15 states", "SW-FGO, 15 states"),
               {"Gain in position RMSE [%]": "position_rmse"}, "15 states"),
        Figure("Figure 11", "Distribution of the position error", "distribution", _SCENARIO, _ALL, part="b"),
        Figure("", "A bias of 25 m for 100 s", "spread", _BIAS, _RIVALS, {"Horizontal error [m]": "horizontal"}),
    ),
    not_shown=(
        NotShown("Table 1", "Methods compared in words", "it holds no figures"),
        NotShown("Table 2", "Instruments", "settings and not results; the scenario coastal-voyage has them"),
        *drawings({"Figure 1": "A factor graph", "Figure 2": "The algorithm"}),
    ),
    notes=(
        "The paper's figures are of one sea trial that is not public. Ours are of a simulated voyage with the same "
        "length, instruments and time of the degradation.",
        "The paper's methods have nine states and fixed sigmas: ekf-9, sw-fgo-paper and ga-fgo-paper stand for them, "
        "and kf-9 and ukf-9 are its KF, with feedback, and its UKF. The same methods with 15 states stand beside them.",
        "Memory is the largest amount that the estimator's process takes beyond its amount at the start.",
    ),
    settings=_SETTINGS,
)  # fmt: skip


_LATE = "the paper does not say which state of the window its errors are of, the newest or an older one"
_HORIZONTAL = "the same by the horizontal error, for the paper does not say how its total of three axes is made"
_DEGRADED = "the sea trial is not public: how often its GNSS is far off is not printed"
_LAGS = (0.0, 5.0, 10.0, 20.0, 29.0, 45.0, 60.0)


def _horizontal(dial: Dial) -> Dial:
    """The same dial with the horizontal error in place of that of three axes."""
    inner = dial.set

    def flat(setting: Setting, value: Choice) -> Setting:
        return inner(replace(setting, score="horizontal_rmse", than_score="horizontal_rmse"), value)

    return replace(dial, title=f"{dial.title.rstrip(',')}, by the horizontal error,", set=flat, ours=None)


def _claim(name: str, methods: tuple[str, str], rows: tuple[str, str], gain: float, *, derived: bool = False,
           both: bool = False) -> Claim:  # fmt: skip
    """A claim on the ship's voyage, with the delay of the output and the share of gross errors as dials."""
    better, than = methods
    sentence = f"the position RMSE of {better} is {100.0 * gain:.1f} % below that of {than}"
    return Claim(
        name, PAPER.key, sentence, gain, compared(lambda: load(_SCENARIO), *rows, "position_rmse"),
        (
            lag_dial(_LAGS, both=both, why=_LATE, window=61),
            _horizontal(lag_dial(_LAGS, both=both, name="lag-horizontal", why=_HORIZONTAL, window=61)),
            scenario_dial("outliers", "the share of fixes with gross errors while GNSS is degraded", "",
                          (0.0, 0.1, 0.3), lambda x: {"fault[2].probability": x}, ours=0.1, why=_DEGRADED),
        ),
        derived,
    )  # fmt: skip


CLAIMS = (
    _claim("guo-sw-fgo", ("SW-FGO", "the EKF"), ("sw-fgo-paper", "ekf-9"), 0.1373, derived=True),
    _claim("guo-ga-fgo", ("GA-FGO", "the EKF"), ("ga-fgo-paper", "ekf-9"), 0.156),
    _claim("guo-ga-over-sw", ("GA-FGO", "SW-FGO"), ("ga-fgo-paper", "sw-fgo-paper"), 0.021, both=True),
)
