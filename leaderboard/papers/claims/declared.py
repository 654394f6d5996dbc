"""The headline claims of the five papers, each with the choices that the paper does not print.

The conditions under which a claim holds are sufficient ones. They do not say what the authors did.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from simnav.leaderboard.campaign.request import request
from simnav.leaderboard.results.errors import RequestError
from simnav.scenario import Scenario, load
from simnav.spec import closest

from .claim import Choice, Claim, Dial, Setting, compared
from .dials import choice_dial, lag_dial, scenario_dial, with_keys

__all__ = ["CLAIMS", "claim_of", "claims_of"]

_LATE = "the paper does not say which state of the window its errors are of, the newest or an older one"
_HORIZONTAL = "the same by the horizontal error, for the paper does not say how its total of three axes is made"
_DEGRADED = "the sea trial is not public: how often its GNSS is far off is not printed"

_FOR_WHICH_TIME = (
    "the paper does not say for which time an estimate of the noise is compared with the true one; a window of 20 "
    "innovations describes its middle"
)
_NETWORK = (
    "the table of instruments is missing from the text at hand; here the network is told the true noise, as one that "
    "has learned it from such data, and the EKF is not"
)
_GRAPH = "the north RMSE of the graph with the equivalent IMU factor"

_LAGS_GUO = (0.0, 5.0, 10.0, 20.0, 29.0, 45.0, 60.0)
_LAGS_MAO = (0.0, 2.0, 5.0, 8.0, 10.0, 12.0, 15.0)


def _percent(gain: float) -> str:
    return f"{100.0 * gain:.1f} %"


def _horizontal(dial: Dial) -> Dial:
    """The same dial with the horizontal error in place of that of three axes."""
    inner = dial.set

    def flat(setting: Setting, value: Choice) -> Setting:
        return inner(replace(setting, score="horizontal_rmse", than_score="horizontal_rmse"), value)

    return replace(dial, title=f"{dial.title.rstrip(',')}, by the horizontal error,", set=flat, ours=None)


def _guo(name: str, sentence: str, row: str, than: str, gain: float, *, derived: bool, both: bool = False) -> Claim:
    """A claim on the ship's voyage, with the delay of the output and the share of gross errors as dials."""
    return Claim(
        name, "guo-2026", sentence, gain,
        compared(lambda: load("coastal-voyage"), row, than, "position_rmse"),
        (
            lag_dial(_LAGS_GUO, both=both, why=_LATE, window=61),
            _horizontal(lag_dial(_LAGS_GUO, both=both, name="lag-horizontal", why=_HORIZONTAL, window=61)),
            scenario_dial("outliers", "the share of fixes with gross errors while GNSS is degraded", "",
                          (0.0, 0.1, 0.3), lambda x: {"fault[2].probability": x}, ours=0.1, why=_DEGRADED),
        ),
        derived,
    )  # fmt: skip


def _mao_sigma(name: str, axis: str, gain: float) -> Claim:
    late = lag_dial(_LAGS_MAO, why=_FOR_WHICH_TIME)
    both = lag_dial((0.0, 10.0), both=True, name="both-late", why="for comparison: a filter may be as late as a graph")
    sentence = f"IAE in a graph estimates the sigma {axis} {_percent(gain)} better than IAE in a filter"
    setting = compared(lambda: load("gnss-noise-step"), "iae-fgo-fixed", "iae-fixed", f"sigma_{axis}_rmse")
    return Claim(name, "mao-2025", sentence, gain, setting, (late, both), derived=True)


def printed_drive(imu_factor: float = 1.0, gnss_factor: float = 5.0) -> Scenario:
    """A simulated drive with the IMU of the road test of Mao, Wang and Fu (2025), its random walks times a factor.

    Printed are 8 deg/h and 15 ug of bias stability, random walks of 0.17 deg/sqrt(h) and 0.02 m/s/sqrt(h) (which are
    34 ug/sqrt(Hz)), and fixes of 1 Hz. The track and the 320 s are those of gnss-noise-step. Ours are the noise of the
    fixes, 1 m, and that it is ``gnss_factor`` times as large for 130 s.
    """
    imu = "instruments.imu"
    keys: Mapping[str, object] = {
        f"{imu}.gyroscope.random_walk_deg_sqrt_h": 0.17 * imu_factor,
        f"{imu}.accelerometer.random_walk_ug_sqrt_hz": 34.0 * imu_factor,
        f"{imu}.accelerometer.bias_ug": 15.0,
        "fault[0].factor": gnss_factor,
        "fault[0].start_s": 60.0,
        "fault[0].end_s": 190.0,
    }
    return with_keys(load("gnss-noise-step"), "drive", f"{imu_factor:g}-{gnss_factor:g}", keys)


def _mao_road(name: str, axis: str, gain: float) -> Claim:
    imu = Dial(
        "imu", "the noise of the IMU, as a multiple of the printed one,", "", (1.0, 3.0, 10.0, 70.0),
        lambda setting, value: setting.on(printed_drive(float(value))), None,
        "the drive is not public; car-road is another drive, whose IMU has 70 times the printed noise, so these values "
        "are of a simulated drive with fixes of 1 Hz, whose noise is five times as large for 130 s",
    )  # fmt: skip
    noise = Dial(
        "noise", "the noise of the fixes for 130 s, as a multiple of the datasheet's,", "", (2.0, 5.0, 10.0, 20.0),
        lambda setting, value: setting.on(printed_drive(1.0, float(value))), None,
        "the paper does not print how noisy its fixes were; the simulated drive has the printed IMU",
    )  # fmt: skip
    return Claim(
        name, "mao-2025", f"on the road the {axis} RMSE of IAE-FGO is {_percent(gain)} below that of Huber-FGO", gain,
        compared(lambda: load("car-road"), "iae-fgo", "huber-fgo", f"{axis}_rmse"), (imu, noise),
    )  # fmt: skip


def _both_told(setting: Setting, value: Choice) -> Setting:
    """Both methods are told the datasheet of ours, and the true noise is larger."""
    keys = {"instruments.gnss.times_datasheet": {"sigma": value}}
    return setting if value == 1.0 else setting.on(with_keys(setting.scenario, "both-told", value, keys))


def _learned(setting: Setting, value: Choice) -> Setting:
    """As `_both_told`, with inputs of the network that are relative to the noise of the last innovations."""
    return _both_told(setting.with_parameters("row", level="learned"), value)


def _than_told(setting: Setting, value: Choice) -> Setting:
    """GNSS with five times the noise of ours, 20 m; the other method is told so many times less."""
    gnss, sigma = "instruments.gnss", (20.0, 20.0, 40.0)
    right = with_keys(setting.scenario, "sigma", 20.0, {f"{gnss}.sigma_m": list(sigma)})
    if value == 1.0:
        return setting.on(right)
    keys = {f"{gnss}.sigma_m": [s / float(value) for s in sigma], f"{gnss}.times_datasheet": {"sigma": value}}
    return replace(setting, scenario=right, than_scenario=with_keys(right, "told", value, keys))


def _noise_step(factor: float) -> Mapping[str, object]:
    step = {"kind": "noise_step", "instruments": ["gnss"], "start_s": 200.0, "end_s": 400.0, "factor": factor}
    return {"fault": [step]}


def _jiang(name: str, motion: str, scenario: str) -> Claim:
    told = (1.0, 2.0, 3.0, 5.0)
    return Claim(
        name, "jiang-2026", f"in {motion} the horizontal error of ANFIS-FGO is 30 to 40 % below that of the EKF", 0.35,
        compared(lambda: load(scenario), "anfis-fgo", "ship-ekf", "horizontal_rmse"),
        (
            Dial("told", "the true GNSS noise (20 m), as a multiple of what the EKF is told,", "", told, _than_told,
                 why=_NETWORK),
            Dial("both-told", "the true GNSS noise, as a multiple of what both are told (4 m),", "", told, _both_told,
                 1.0, "for comparison: the network is told the wrong noise as well"),
            Dial("both-told-learned", "the same, with a network that learns the level of the noise", "", told, _learned,
                 why="for comparison: anfis-fgo with level=learned"),
            scenario_dial("noise", "the GNSS noise for 200 s of the run, as a multiple of the datasheet's,", "",
                          (1.0, 3.0, 5.0, 10.0), _noise_step, ours=1.0,
                          why="the text does not say that the noise of its GNSS changes"),
        ),
        derived=True,
    )  # fmt: skip


def _than(name: str) -> Callable[[Setting], Setting]:
    return lambda setting: replace(setting, than=request(name))


def _than_on(name: str, scenario: str) -> Callable[[Setting], Setting]:
    return lambda setting: replace(setting.on(load(scenario)), than=request(name))


def _auv(name: str, sentence: str, row: str, score: str, gain: float, than_score: str = "") -> Claim:
    return Claim(
        name, "auv-smoothing-2022", sentence, gain,
        compared(lambda: load("auv-survey"), row, "federated", score, than_score),
        (
            choice_dial(
                "fusion", "the federated filter",
                {"resets": _than("federated"), "does not reset": _than("federated-no-reset")}, ours="resets",
                why="the paper prints neither its information-sharing factors nor whether its local filters are reset",
            ),
            choice_dial(
                "intervals", "the intervals of the instruments and the federated filter",
                {
                    "first set, resets": _than("federated"),
                    "second set, resets": _than_on("federated", "auv-survey-sparse"),
                    "second set, does not reset": _than_on("federated-no-reset", "auv-survey-sparse"),
                },
                ours="first set, resets",
                why="the gains of the text do not say which of the two sets of intervals they are of",
            ),
        ),
    )  # fmt: skip


def _zhan(name: str, axis: str, gain: float) -> Claim:
    def rows(row: str, than: str) -> Callable[[Setting], Setting]:
        return lambda setting: replace(setting, row=request(row), than=request(than))

    segments = "factor=three-segment"
    return Claim(
        name, "zhan-2026", f"the {axis} RMSE of the three-segment ADKF is {_percent(gain)} below that of the KF", gain,
        compared(lambda: load("uuv-lake"), f"adkf:{segments}", "ekf-23", f"{axis}_rmse"),
        (
            choice_dial(
                "noise", "the measurement noise of the KF and the statistic of the ADKF",
                {
                    "datasheet, whitened": rows(f"adkf:{segments}", "ekf-23"),
                    "printed, whitened": rows(f"adkf:{segments}", "ekf-23:preset=paper"),
                    "datasheet, as printed": rows(f"adkf-paper:{segments}", "ekf-23"),
                    "printed, as printed": rows(f"adkf-paper:{segments}", "ekf-23:preset=paper"),
                },
                ours="datasheet, whitened",
                why="the paper prints the noise of its KF, and a statistic with mixed units that fires on clean data",
            ),
            scenario_dial("outliers", "the share of fixes with gross errors", "", (0.05, 0.15, 0.25, 0.4),
                          lambda x: {"fault[1].probability": x}, ours=0.25,
                          why="the paper prints the sizes of the gross errors, and not how often they occur"),
        ),
    )  # fmt: skip


CLAIMS: tuple[Claim, ...] = (
    _guo("guo-sw-fgo", "the position RMSE of SW-FGO is 13.7 % below that of the EKF", "sw-fgo-paper", "ekf-9", 0.1373,
         derived=True),
    _guo("guo-ga-fgo", "the position RMSE of GA-FGO is 15.6 % below that of the EKF", "ga-fgo-paper", "ekf-9", 0.156,
         derived=False),
    _guo("guo-ga-over-sw", "the position RMSE of GA-FGO is 2.1 % below that of SW-FGO", "ga-fgo-paper", "sw-fgo-paper",
         0.021, derived=False, both=True),
    _mao_sigma("mao-sigma-east", "east", 0.3118),
    _mao_sigma("mao-sigma-north", "north", 0.1697),
    _mao_road("mao-road-north", "north", 0.1764),
    _mao_road("mao-road-east", "east", 0.1273),
    _jiang("jiang-turn", "a steady turn (CTM)", "ship-turn"),
    _jiang("jiang-straight", "a straight course (CALM)", "ship-straight"),
    _auv("auv-graph", f"{_GRAPH} is 33.2 % below that of the federated filter", "sw-fgo", "north_rmse", 0.3315),
    _auv("auv-smoothing", "the north RMSE after smoothing is 76.3 % below that of the federated filter",
         "ekf-two-filter", "smoothed_north_rmse", 0.7631, "north_rmse"),
    _zhan("zhan-east", "east", 0.281),
    _zhan("zhan-north", "north", 0.221),
)  # fmt: skip


def claims_of(paper: str) -> list[Claim]:
    """The claims of a paper, by its key."""
    return [claim for claim in CLAIMS if claim.paper == paper]


def claim_of(name: str) -> Claim:
    """The claim of a name.

    Raises
    ------
    RequestError
        If there is none; one sentence.
    """
    for claim in CLAIMS:
        if claim.name == name:
            return claim
    raise RequestError(f"there is no claim {name!r}{closest(name, [c.name for c in CLAIMS])}")
