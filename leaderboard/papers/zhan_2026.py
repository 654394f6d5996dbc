"""Zhan et al. (2026): an adaptive filter on a UUV at the surface, with gross errors in GNSS and DVL."""

from __future__ import annotations

from functools import partial

from simnav.scenario import Scenario, load
from simnav.sensors import GnssPosition
from simnav.sensors.gnss_raw import GnssRaw
from simnav.sensors.gnss_receiver import GnssReceiver

from .claims.claim import Claim, compared
from .claims.dials import choice_dial, of_rows, scenario_dial
from .declarations import DRAWING, PHOTOGRAPH, error_figures, measured
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

_DISTURBED, _LAKE, _CLEAN = "uuv-surface", "uuv-lake", "uuv-lake-clean"
#: Gross errors on pseudoranges; how many of them have one. Of 0.1, 0.25, 0.5 and 1 this is the share with which the
#: horizontal error of the KF grows most like the paper's, on seeds from 500 on, which are not judged. The figures of
#: the ADKF were printed beside it.
_RANGES, _SHARE_OF_RANGES = "uuv-lake-pseudoranges", 0.5
_AXES = (
    "tilt_east_rmse", "tilt_north_rmse", "heading_rmse", "velocity_east_rmse", "velocity_north_rmse",
    "velocity_vertical_rmse", "east_rmse", "north_rmse", "vertical_rmse",
)  # fmt: skip
# Error angle E, N, U [deg], velocity E, N, U [m/s], position E, N, U [m].
_TABLE_3 = {
    "KF": (0.0434, 0.0068, 1.5068, 0.0261, 0.0233, 0.0087, 2.6649, 3.2752, 4.1198),
    "ADKF, two segments": (0.0427, 0.0061, 1.5068, 0.0241, 0.0205, 0.0086, 1.9353, 2.5730, 4.0570),
    "ADKF, three segments": (0.0427, 0.0061, 1.5067, 0.0241, 0.0205, 0.0087, 1.9154, 2.5520, 4.0386),
    "ADKF, exponential": (0.0427, 0.0061, 1.5068, 0.0241, 0.0205, 0.0086, 1.9155, 2.5519, 4.0417),
}
_TABLE_2 = {
    "GNSS alone": (0.0508, 0.0440, 0.1011, 2.3844, 2.8315, 4.7342),
    "KF": (0.0241, 0.0205, 0.0086, 1.9244, 2.5408, 4.0566),
}
_ALIGNMENT = (
    "on a nearly straight course the tilt and the bias of an accelerometer cannot be separated, so the error of the "
    "initial alignment remains. Ours is 0.05 deg; the paper does not print its own"
)
_YAW = "the paper's 1.5 deg is the same for all its filters, to the fourth digit, and so has another cause"
_VELOCITY = (
    "our GNSS velocity and DVL have white noise of 0.1 m/s each, which averages out; the paper names only its size"
)
_VERTICAL = (
    "the paper's vertical velocity is three times as accurate as its horizontal velocity. A DVL with 0.1 m/s on each "
    "axis does not give that"
)
_HIT = "the paper does not print how often gross errors occur in velocities"
_TILT = (
    "0.5 m/s^2 for 500 s looks like a tilt of 2.9 deg, and a filter without knowledge of it estimates such a tilt. The "
    "paper's error angles of hundredths of a degree show that its disturbance was another one than printed"
)
_SMOOTHED = "our estimator smooths the fixes with a model of the motion; the paper's figures are of single fixes"
_PRINTED = "the factor as printed also rejects most correct fixes, so the filter depends on its IMU"
_PRINTED_23 = "with the printed noise of 5 m a gross error harms the KF less"
_MANY = "how many pseudoranges have a gross error is not printed, and is ours"
_GNSS_VELOCITY = "the noise of the GNSS velocity, 0.1 m/s, is our choice"


def _why(score: str) -> tuple[str, str]:
    if score == "heading_rmse":
        return _YAW, ""
    if "tilt" in score:
        return _ALIGNMENT, _ALIGNMENT
    if score == "velocity_vertical_rmse":
        return "", _VERTICAL
    if "velocity" in score:
        return _VELOCITY, _HIT
    return "", ""


def _table_3() -> tuple[Row, ...]:
    return tuple(
        Value(_LAKE, method, score, figure, lower=_why(score)[0], higher=_why(score)[1])
        for method, figures in _TABLE_3.items()
        for score, figure in zip(_AXES, figures, strict=True)
    )


def _as_printed() -> tuple[Row, ...]:
    rows: list[Row] = []
    for method in ("KF", "ADKF, three segments"):
        figures = dict(zip(_AXES, _TABLE_3[method], strict=True))
        for score in ("tilt_east_rmse", "tilt_north_rmse", "east_rmse", "north_rmse", "vertical_rmse"):
            rows.append(Value(_DISTURBED, method, score, figures[score], higher=_TILT))
    return (*rows, *measured(_DISTURBED, ("EKF",), ("east_rmse", "north_rmse", "vertical_rmse")))


def _table_2() -> tuple[Row, ...]:
    rows = []
    for method, figures in _TABLE_2.items():
        for score, figure in zip(_AXES[3:], figures, strict=True):
            lower, higher = _why(score)
            if method == "GNSS alone":
                lower, higher = ("", _GNSS_VELOCITY) if "velocity" in score else (_SMOOTHED, "")
            rows.append(Value(_CLEAN, method, score, figure, lower=lower, higher=higher))
    return tuple(rows)


def _claims() -> tuple[Row, ...]:
    gains = {"tilt_north_rmse": 0.103, "velocity_east_rmse": 0.077, "velocity_north_rmse": 0.12,
             "east_rmse": 0.281, "north_rmse": 0.221}  # fmt: skip
    rows: list[Row] = []
    for method in ("ADKF, three segments", "ADKF as printed, three segments"):
        for score, gain in gains.items():
            lower = higher = _ALIGNMENT if "tilt" in score else _PRINTED if "printed" in method else ""
            rows.append(
                Gain(_LAKE, method, "KF", score, gain, lower=lower, higher=_HIT if "velocity" in score else higher)
            )
    return tuple(rows)


#: The ADKF with the states of the KF and its printed noise: the statistic of the literature, and the printed one.
_ADKF_23 = {
    "ADKF, 23 states, printed noise": "model__preset=paper",
    "ADKF as printed, 23 states, printed noise": "model__preset=paper,adaptation__preset=paper,c0=1.5,c1=4,together=0",
}


def _claims_23() -> tuple[Row, ...]:
    whitened, as_printed = _ADKF_23
    gains = {"east_rmse": 0.281, "north_rmse": 0.221}
    return (
        *(Gain(_LAKE, whitened, "KF, printed noise", score, gain, lower=_PRINTED_23, higher=_PRINTED_23)
          for score, gain in gains.items()),
        *(Gain(_LAKE, as_printed, "KF, printed noise", score, gain, lower=_PRINTED, higher=_PRINTED)
          for score, gain in gains.items()),
    )  # fmt: skip


_LOOSE = {"KF": "KF, receiver", "ADKF, three segments": "ADKF, three segments, receiver"}


def _on_pseudoranges() -> tuple[Row, ...]:
    rows: list[Row] = [
        Value(_RANGES, method, score, figure, lower=_MANY, higher=_MANY)
        for printed, method in _LOOSE.items()
        for score, figure in zip(_AXES[6:], _TABLE_3[printed][6:], strict=True)
    ]
    kf, adkf = _LOOSE.values()
    for score, gain in (("east_rmse", 0.281), ("north_rmse", 0.221)):
        rows.append(Gain(_RANGES, adkf, kf, score, gain, lower=_MANY, higher=_MANY))
    return tuple(rows)


def _with_pseudoranges(scenario: Scenario) -> Scenario:
    """Fixes that a receiver solves from pseudoranges, on which the gross errors are.

    As printed: two frequencies without ionosphere, a mask of 12 degrees, single points without RAIM, 1 to 60 m. The
    fixes keep their drift, and the datasheet its 3 m. The ephemerides are those that come with simnav.
    """
    fix = scenario.aids["gnss"]
    assert isinstance(fix, GnssPosition)
    arm = {"lever_arm_m": list(fix.lever_arm)}
    place = {"latitude_deg": 32.6, "longitude_deg": 111.6, "span_s": scenario.duration, "mask_deg": 12.0}
    raw = GnssRaw.from_toml(
        {**place, **arm, "frequencies": 2, "sigma_pseudorange_m": 0.3, "sigma_range_rate_m_s": 0.05}
    )
    receiver = GnssReceiver.from_toml(
        {**arm, "observations": "satellites", "sigma_m": list(fix.sigma), "false_alarm": 0.0}
    )
    drift, gross, of_velocities = scenario.faults
    on_ranges = {"instruments": ("satellites",), "probability": _SHARE_OF_RANGES, "size_velocity": (0.0, 0.0)}
    return scenario.model_copy(
        update={
            "instruments": {**scenario.instruments, "satellites": raw, "gnss": receiver},
            "faults": (drift, gross.model_copy(update=on_ranges), of_velocities),
        }
    )


def _without_gross_errors(scenario: Scenario) -> Scenario:
    return scenario.model_copy(update={"faults": tuple(f for f in scenario.faults if f.kind != "gross_error")})


_SCHEMES = {"two segments": "two-segment", "three segments": "three-segment", "exponential": "exponential"}
_ADKF = tuple(f"ADKF, {words}" for words in _SCHEMES)
_ADKF_PRINTED = tuple(f"ADKF as printed, {words}" for words in _SCHEMES)
_COMPARED = ("KF", *_ADKF)


_set = partial(setting_of, _LAKE)
_SETTINGS = (
    _set("length [s]", "printed", "2400 s", "duration_s"),
    _set("distance and speed [m/s]", "printed", "4011 m in 2400 s, which is 1.67 m/s", "start.speed_m_s"),
    _set("place, latitude [deg]", "printed", "the Danjiangkou reservoir", "start.latitude_deg"),
    _set("rate of the IMU [Hz]", "printed", "100 Hz", "instruments.imu.rate_hz"),
    _set("gyroscope bias [deg/h]", "printed", "0.01 deg/h", "instruments.imu.gyroscope.bias_deg_h"),
    _set("angular random walk [deg/sqrt(h)]", "printed", "0.01, with the unit of a bias",
         "instruments.imu.gyroscope.random_walk_deg_sqrt_h"),
    _set("accelerometer bias [ug]", "printed", "1000 ug", "instruments.imu.accelerometer.bias_ug"),
    _set("velocity random walk [ug/sqrt(Hz)]", "printed", "100 ug/sqrt(Hz)",
         "instruments.imu.accelerometer.random_walk_ug_sqrt_hz"),
    _set("rate of the DVL [Hz]", "printed", "1 Hz", "instruments.dvl.rate_hz"),
    _set("noise of the DVL [m/s]", "printed", "about 0.1 m/s in operation (0.005 m/s in the table)",
         "instruments.dvl.sigma_m_s", "(0.005 in uuv-surface)"),
    _set("scale error of the DVL [%]", "printed", "2.55 %", "instruments.dvl.scale_percent"),
    _set("misalignment of the DVL [deg]", "printed", "0.028, -0.010, -0.266 deg", "instruments.dvl.misalignment_deg",
         "(the size of what each run draws)"),
    _set("lever arm of the DVL [m]", "printed", "0, 0.471, -0.044 m", "instruments.dvl.lever_arm_m",
         "(other axes)"),
    _set("lever arm of the antenna [m]", "printed", "0, 2.723, -0.558 m", "instruments.gnss.lever_arm_m",
         "(other axes)"),
    _set("noise of the fixes, north, east, down [m]", "printed", "about 3 m", "instruments.gnss.sigma_m",
         "(the vertical is ours)"),
    _set("noise of the GNSS velocity [m/s]", "ours", "", "instruments.gnss_velocity.sigma_m_s"),
    _set("slow error of the fixes, north, east, down [m]", "ours", "implied by its Table 2", "fault[0].sigma_m"),
    _set("measurement noise of the KF: velocity, position", "printed", "0.1 m/s, 5 m", "",
         "0.1 m/s, 5 m in the rows with printed noise; that of the datasheets in the others"),
    _set("gross errors from [s]", "printed", "500 s", "fault[1].start_s"),
    _set("gross errors of positions [m]", "printed", "1 to 60 m, of pseudoranges", "fault[1].size_m"),
    _set("share of positions with gross errors", "ours", "", "fault[1].probability"),
    _set("share of pseudoranges with gross errors", "ours", "", "",
         f"{_SHARE_OF_RANGES:g} in {_RANGES}"),
    _set("gross errors of velocities [m/s]", "printed", "0.5 to 1 m/s", "fault[2].size_m_s"),
    _set("share of velocities with gross errors", "ours", "", "fault[2].probability"),
    _set("disturbance of the accelerometers, 0 to 500 s [m/s^2]", "printed", "0.5 m/s^2", "",
         "0.5 in uuv-surface; none in uuv-lake, because the printed error angles exclude it"),
    _set("thresholds of the factors", "printed", "c = 1; c0 = 1.5, c1 = 4", "",
         "as printed with the printed statistic; 2 and 8 with the whitened one"),
    _set("initial alignment", "ours", "", "", "0.05, 0.05, 0.2 deg"),
)  # fmt: skip


PAPER = Paper(
    key="zhan-2026",
    authors="Z. Zhan, C. Liu, K. Jin, M. Xiang and M. Wang",
    short="Zhan et al. (2026)",
    title="GNSS/SINS/DVL integrated navigation algorithm based on adaptive differential Kalman filtering",
    published="PLoS One 21(2), e0342016, 2026",
    doi="10.1371/journal.pone.0342016",
    about="a UUV at the surface with INS, GNSS and DVL: a Kalman filter with adaptive factors",
    runs=5,
    full=100,
    methods=(
        Method("GNSS alone", ("gnss-only",)),
        Method("KF", ("ekf-23", "kf-23")),
        Method("KF, open loop", ("kf-23",)),
        *(Method(m, (f"adkf:factor={name}",)) for m, name in zip(_ADKF, _SCHEMES.values(), strict=True)),
        *(Method(m, (f"adkf-paper:factor={name}",)) for m, name in zip(_ADKF_PRINTED, _SCHEMES.values(), strict=True)),
        Method("EKF", ("ekf",)),
        Method("KF, printed noise", ("ekf-23:preset=paper",)),
        *(Method(m, (f"adkf-23:factor=three-segment,{how}",)) for m, how in _ADKF_23.items()),
        Method(_LOOSE["KF"], ("ekf-23:loose=true",)),
        Method(_LOOSE["ADKF, three segments"], ("adkf:factor=three-segment,loose=true",)),
    ),
    tables=(
        Table("With gross errors", _table_3(), "Table 3"),
        Table("Claims: gain of ADKF over KF", _claims()),
        Table("Claims with 23 states and the printed measurement noise", _claims_23()),
        Table(
            "For comparison: the KF without feedback, the ADKF as printed, and the filter without adaptation",
            measured(_LAKE, ("KF, open loop", *_ADKF_PRINTED, "EKF"),
                     ("east_rmse", "north_rmse", "vertical_rmse", "velocity_horizontal_rmse")),
        ),
        Table("With the disturbance as printed, 0.5 m/s^2 for 500 s, and the instruments of Table 1", _as_printed()),
        Table("GNSS alone and integrated, undisturbed", _table_2(), "Table 2"),
        Table("With gross errors on pseudoranges, which a receiver solves", _on_pseudoranges(), "Table 3"),
    ),
    figures=(
        Figure("Figure 3", "The straight course", "track", _CLEAN, ("GNSS alone", "KF")),
        *error_figures(
            _CLEAN,
            ("GNSS alone", "KF"),
            {
                "Figure 4": ("Velocity errors of GNSS alone and integrated", VELOCITY),
                "Figure 5": ("Position errors of GNSS alone and integrated", POSITION),
            },
        ),
        *error_figures(
            _LAKE,
            _COMPARED,
            {
                "Figure 6": ("Attitude errors of KF and ADKF", ATTITUDE),
                "Figure 7": ("Velocity errors of KF and ADKF", VELOCITY),
                "Figure 8": ("Position errors of KF and ADKF", POSITION),
            },
        ),
        Figure("", "Position RMSE of all forms", "bars", _LAKE, (*_COMPARED, *_ADKF_PRINTED),
               {"East [m]": "east_rmse", "North [m]": "north_rmse", "Up [m]": "vertical_rmse"}),
        Figure("", "Adaptive factors of the GNSS fixes and the DVL", "run", _LAKE,
               ("ADKF, three segments", "ADKF as printed, three segments"),
               {"GNSS": "factor.gnss", "DVL": "factor.dvl"}),
        Figure("", "Errors with gross errors, all runs", "spread", _LAKE, _COMPARED,
               {"Horizontal error [m]": "horizontal", "Velocity error [m/s]": "velocity"}),
    ),
    not_shown=(
        NotShown("Table 1", "Instruments", "settings and not results; the scenario uuv-surface has them"),
        NotShown("Figure 1", "The algorithm", DRAWING),
        NotShown("Figure 2", "The vehicle", PHOTOGRAPH),
    ),
    notes=(
        "The paper compares its filters on one recorded run. Its raw data are not used here.",
        "Tables 2 and 3 are run on uuv-lake: its fixes drift, its DVL has the 0.1 m/s that the paper's text names, and "
        "the accelerometers are not disturbed. The paper's tables imply all three. The drift of the fixes and the rate "
        "of gross errors were chosen so that the position of the KF agrees, with the figures of ADKF in view. So the "
        "KF agrees by construction, and the agreement of ADKF is a partial test. With white errors of the datasheets' "
        "size (uuv-surface without its disturbance) only gross errors remain, and ADKF gains about 94 %.",
        "The paper adds its gross errors to pseudoranges, and solves single points from them. The last table has them "
        "there: half of all pseudoranges are off by 1 to 60 m, and a receiver without RAIM solves them. The other "
        "tables add them to the fixes themselves.",
        "The paper's ADKF has the 23 states of its KF. Ours adapts the filter with 15 states and the DVL's scale "
        "factor and misalignment; without adaptation it is the EKF of the fourth table. adkf-23 has the 23 states.",
    ),
    settings=_SETTINGS,
    variants={_CLEAN: (_LAKE, _without_gross_errors), _RANGES: (_LAKE, _with_pseudoranges)},
)  # fmt: skip


def _claim(name: str, what: str, score: str, gain: float) -> Claim:
    segments, printed = "factor=three-segment", "ekf-23:preset=paper"
    whitened, as_printed = (f"adkf-23:{segments},{how}" for how in _ADKF_23.values())
    sentence = f"the {what} RMSE of the three-segment ADKF is {100.0 * gain:.1f} % below that of the KF"
    return Claim(
        name, PAPER.key, sentence, gain, compared(lambda: load(_LAKE), f"adkf:{segments}", "ekf-23", score),
        (
            choice_dial(
                "noise", "the measurement noise of the KF and the statistic of the ADKF",
                {
                    "datasheet, whitened": of_rows(f"adkf:{segments}", "ekf-23"),
                    "printed, whitened": of_rows(f"adkf:{segments}", printed),
                    "datasheet, as printed": of_rows(f"adkf-paper:{segments}", "ekf-23"),
                    "printed, as printed": of_rows(f"adkf-paper:{segments}", printed),
                    "printed, whitened, both with 23 states": of_rows(whitened, printed),
                    "printed, as printed, both with 23 states": of_rows(as_printed, printed),
                },
                ours="datasheet, whitened",
                why="the paper prints the noise of its KF, and a statistic with mixed units that fires on clean data",
            ),
            scenario_dial("outliers", "the share of fixes with gross errors", "", (0.05, 0.15, 0.25, 0.4),
                          lambda x: {"fault[1].probability": x}, ours=0.25,
                          why="the paper prints the sizes of the gross errors, and not how often they occur"),
        ),
    )  # fmt: skip


CLAIMS = (
    _claim("zhan-east", "east", "east_rmse", 0.281),
    _claim("zhan-north", "north", "north_rmse", 0.221),
)
