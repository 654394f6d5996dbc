"""Mao, Wang and Fu (2025): the noise of GNSS, estimated from innovations in filters and in factor graphs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from simnav.scenario import Scenario, load

from .claims.claim import Choice, Claim, Dial, Setting, compared
from .claims.dials import lag_dial, with_keys
from .declarations import PHOTOGRAPH, drawings, measured
from .paper import POSITION, Figure, Gain, Method, NotShown, Paper, Row, Table, Value
from .settings import setting_of

__all__ = ["CLAIMS", "PAPER"]

_SCENARIO, _ROAD, _DRIVE = "gnss-noise-step", "car-road", "mao-drive"
_LAG = "the window needs 10 to 20 s to follow each step of the noise, and most of this error arises in that time"
_BETTER = (
    "our estimate of the variances is bounded and uses the covariance of the newest state, whereas the paper's eq. 15 "
    "uses that of the oldest state"
)
_SEEDS = "the paper shows one run; ours is the mean over many runs"
_FIXES = (
    "the paper does not print how noisy its fixes are, nor when; ours are five times as noisy for 130 of 320 s, and "
    "the gain grows with this noise (see the claims)"
)
_SAME_INNOVATIONS = (
    "the newest state of a window predicts the next fix as a filter does. The innovations are the same, and so are the "
    "estimates of the noise. The gain is there if the estimate is compared with the noise of some seconds before (see "
    "the claims)"
)
_LENGTH = "the length of the window changes the delay at each step by a few seconds only; the paper shows one run"
_SAME = (
    "of the newest state, with the same states and noise, a window gains nothing over a well linearised filter; of an "
    "older state it does"
)
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


def _road(scenario: str) -> tuple[Row, ...]:
    return tuple(
        Value(scenario, method, f"{axis}_{statistic}", figure, rule="beside")
        for method, rows in _TABLE_3.items()
        for axis, figures in zip(_AXES, rows, strict=True)
        for statistic, figure in zip(("mae", "max", "rmse"), figures, strict=True)
    )


def _road_claims() -> tuple[Row, ...]:
    rows: list[Row] = []
    for axis, printed, column in zip(_AXES, (0.1764, 0.1273, 0.0571), range(3), strict=True):
        rms = {method: figures[column][2] for method, figures in _TABLE_3.items()}
        rows += [
            Gain(_DRIVE, "IAE-FGO", "Huber-FGO", f"{axis}_rmse", printed, lower=_FIXES, higher=_FIXES),
            *(
                Gain(_DRIVE, a, b, f"{axis}_rmse", round(1.0 - rms[a] / rms[b], 4), derived=True, lower=why,
                     higher=_FIXES)
                for a, b, why in (("IAE-FGO", "EKF", _FIXES), ("Huber-FGO", "FGO", _FIXES), ("FGO", "EKF", _SAME))
            ),
            Gain(_ROAD, "IAE-FGO", "Huber-FGO", f"{axis}_rmse"),
        ]  # fmt: skip
    return tuple(rows)


_IMU = "instruments.imu"
_PRINTED_IMU: Mapping[str, float] = {
    f"{_IMU}.gyroscope.random_walk_deg_sqrt_h": 0.17,
    f"{_IMU}.accelerometer.random_walk_ug_sqrt_hz": 34.0,  # 0.02 m/s/sqrt(h)
    f"{_IMU}.accelerometer.bias_ug": 15.0,
}
_NOISY: Mapping[str, float] = {"fault[0].factor": 5.0, "fault[0].start_s": 60.0, "fault[0].end_s": 190.0}


def _drive(scenario: Scenario) -> Scenario:
    """A simulated drive with the IMU and the GNSS rate of the paper's road test; fixes and track are ours."""
    return scenario.with_values({"name": _DRIVE, **_PRINTED_IMU, **_NOISY})


def _drive_with(drive: Scenario, dial: str, value: float) -> Scenario:
    """The drive with its random walks, or the noise of its fixes, times a factor."""
    walks = {key: value * walk for key, walk in _PRINTED_IMU.items() if "random_walk" in key}
    return with_keys(drive, dial, value, walks if dial == "imu" else {"fault[0].factor": value})


_set = partial(setting_of, _SCENARIO)
_SETTINGS = (
    _set("simulation: length [s]", "printed", "320 s", "duration_s"),
    _set("simulation: rate of the IMU [Hz]", "printed", "100 Hz", "instruments.imu.rate_hz"),
    _set("simulation: gyroscope bias [deg/h]", "printed", "8 deg/h", f"{_IMU}.gyroscope.bias_deg_h"),
    _set("simulation: angular random walk [deg/sqrt(h)]", "printed", "0.4 deg/sqrt(h)",
         f"{_IMU}.gyroscope.random_walk_deg_sqrt_h"),
    _set("simulation: accelerometer bias [ug]", "printed", "30 ug", f"{_IMU}.accelerometer.bias_ug"),
    _set("simulation: velocity random walk [ug/sqrt(Hz)]", "printed", "0.02 m/s/sqrt(h)",
         f"{_IMU}.accelerometer.random_walk_ug_sqrt_hz"),
    _set("simulation: walk of the gyroscope bias [deg/h/sqrt(h)]", "ours", "",
         f"{_IMU}.gyroscope.rate_random_walk_deg_h_sqrt_h"),
    _set("simulation: rate of GNSS [Hz]", "printed", "1 Hz", "instruments.gnss.rate_hz"),
    _set("simulation: noise of GNSS, north, east, down [m]", "printed", "1 m, north and east",
         "instruments.gnss.sigma_m", "(the vertical is ours)"),
    _set("simulation: noise of GNSS in the step, as a multiple", "printed", "10 m", "fault[0].factor"),
    _set("simulation: begin of the step [s]", "printed", "160 s", "fault[0].start_s"),
    _set("simulation: end of the step [s]", "printed", "240 s", "fault[0].end_s"),
    _set("simulation: track", "ours", "", "", "that of gnss-noise-step"),
    _set("shortest and longest window of the innovations", "printed", "10 and 20", "", "10 and 20"),
    _set("window of IAE-FGO-Fix", "ours", "", "", "20"),
    _set("weight of the newest estimate (alpha)", "printed", "0.9", "", "0.9"),
    _set("limits of the variance for the length of the window", "ours", "", "", "multiples of the expected variance"),
    _set("road: rates of IMU and GNSS", "printed", "100 Hz, 1 Hz", "", "100 Hz, 1 Hz (mao-drive)"),
    _set("road: gyroscope bias, angular random walk", "printed", "8 deg/h, 0.17 deg/sqrt(h)", "",
         "8 deg/h, 0.17 deg/sqrt(h) (mao-drive)"),
    _set("road: accelerometer bias, velocity random walk", "printed", "15 ug, 0.02 m/s/sqrt(h)", "",
         "15 ug, 34 ug/sqrt(Hz) (mao-drive)"),
    _set("road: length and track", "ours", "a figure of the track, without figures", "",
         "320 s, the track of the simulation (mao-drive)"),
    _set("road: noise of GNSS", "ours", "", "", "1 m, and 5 m for 130 s (mao-drive)"),
)  # fmt: skip


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
        Table("Position errors on a simulated drive with the printed IMU", _road(_DRIVE), "Table 3"),
        Table("Position errors on a recorded drive with another IMU", _road(_ROAD)),
        Table("Claims of the road test", _road_claims()),
    ),
    figures=(
        Figure("Figure 1", "GNSS sigma, estimated and true", "run", _SCENARIO, tuple(_TABLE_2),
               {"East sigma [m]": "sigma_east.gnss", "North sigma [m]": "sigma_north.gnss"}),
        Figure("Figure 4", "Trajectories on the road", "track", _DRIVE, tuple(_TABLE_3)),
        Figure("Figure 5", "Position errors on the road", "run", _DRIVE, tuple(_TABLE_3), POSITION),
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
        "The data of the road test are not public. Its claims are run on mao-drive, a simulated drive with the printed "
        "IMU and GNSS rate, whose fixes are five times as noisy for 130 s. car-road is a recorded drive (KITTI) with "
        "another IMU: the random walks of its gyroscopes are 70 times the printed ones. Its rows have no verdict.",
    ),
    settings=_SETTINGS,
    variants={_DRIVE: (_SCENARIO, _drive)},
)  # fmt: skip


_FOR_WHICH_TIME = (
    "the paper does not say for which time an estimate of the noise is compared with the true one; a window of 20 "
    "innovations describes its middle"
)
_LAGS = (0.0, 2.0, 5.0, 8.0, 10.0, 12.0, 15.0)


def _sigma_claim(name: str, axis: str, gain: float) -> Claim:
    late = lag_dial(_LAGS, why=_FOR_WHICH_TIME)
    both = lag_dial((0.0, 10.0), both=True, name="both-late", why="for comparison: a filter may be as late as a graph")
    sentence = f"IAE in a graph estimates the sigma {axis} {100.0 * gain:.1f} % better than IAE in a filter"
    setting = compared(lambda: load(_SCENARIO), "iae-fgo-fixed", "iae-fixed", f"sigma_{axis}_rmse")
    return Claim(name, PAPER.key, sentence, gain, setting, (late, both), derived=True)


def _with_limits(setting: Setting, value: Choice) -> Setting:
    return setting.with_parameters("row", low=float(value), high=2.5 * float(value))


def _window_claim(name: str, axis: str, gain: float) -> Claim:
    limits = Dial(
        "limits", "the lower limit of the variance for the length of the window, as a multiple of the expected one,",
        "", (2.0, 5.0, 10.0, 20.0, 50.0), _with_limits, 2.0,
        "the paper prints neither v_min nor v_max of its eq. 20; here the upper limit is 2.5 times the lower one",
    )  # fmt: skip
    both = lag_dial((0.0, 5.0, 10.0), both=True, name="both-late", why=_FOR_WHICH_TIME)
    sentence = f"the adaptive window estimates the sigma {axis} {100.0 * gain:.1f} % better than the fixed one"
    setting = compared(lambda: load(_SCENARIO), "iae-fgo", "iae-fgo-fixed", f"sigma_{axis}_rmse")
    return Claim(name, PAPER.key, sentence, gain, setting, (limits, both))


def _road_claim(name: str, axis: str, gain: float) -> Claim:
    imu = Dial(
        "imu", "the noise of the IMU, as a multiple of the printed one,", "", (1.0, 3.0, 10.0, 70.0),
        lambda setting, value: setting.on(_drive_with(setting.scenario, "imu", float(value))), 1.0,
        "the drive is not public; these are simulated drives with fixes of 1 Hz, whose noise is five times as large "
        "for 130 s. The IMU of the recorded drive car-road has 70 times the printed noise",
    )  # fmt: skip
    noise = Dial(
        "noise", "the noise of the fixes for 130 s, as a multiple of the datasheet's,", "", (2.0, 5.0, 10.0, 20.0),
        lambda setting, value: setting.on(_drive_with(setting.scenario, "noise", float(value))), 5.0,
        "the paper does not print how noisy its fixes were; the simulated drive has the printed IMU",
    )  # fmt: skip
    sentence = f"on the road the {axis} RMSE of IAE-FGO is {100.0 * gain:.1f} % below that of Huber-FGO"
    setting = compared(lambda: PAPER.scenario(_DRIVE), "iae-fgo", "huber-fgo", f"{axis}_rmse")
    return Claim(name, PAPER.key, sentence, gain, setting, (imu, noise))


CLAIMS = (
    _sigma_claim("mao-sigma-east", "east", 0.3118),
    _sigma_claim("mao-sigma-north", "north", 0.1697),
    _road_claim("mao-road-north", "north", 0.1764),
    _road_claim("mao-road-east", "east", 0.1273),
)
