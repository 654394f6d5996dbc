"""The requests of the calls that look at the errors of instruments: `simnav.allan` and `simnav.realism`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY

from .calls import option, request
from .requests import SCENARIO, SCENARIO_MORE, ScenarioLike

__all__ = ["AllanRequest", "RealismRequest"]


@request
class AllanRequest:
    """The Allan deviation of an IMU and its noise coefficients, beside its datasheet.

    Of a simulated scenario it is that of the errors at rest; of a log, that of the recorded samples, with all motion
    that is in them.
    """

    scenario: ScenarioLike = option(
        help="A scenario, simulated or recorded, or a recording (.npz).",
        more=SCENARIO_MORE,
        argument=True,
        metavar="SCENARIO_OR_LOG",
    )
    _: KW_ONLY
    seed: int = option(default=0, help="Seed of the simulated errors; of a log, the number of the recording.", least=0)
    duration: float = option(default=21600.0, least=1.0, help="Seconds that are simulated.")
    start: float = option(default=0.0, least=0.0, help="Of a log: begin here, in seconds.")
    end: float | None = option(default=None, least=0.0, help="Of a log: end here, in seconds. Default: at its end.")


@request
class RealismRequest:
    """Whether the simulated errors of instruments are like those of a recording.

    A logistic classifier is trained on windows of 60 s of the errors, real and simulated, and tried on recordings that
    it has not seen. It needs scikit-learn (the extra ``realism``).
    """

    scenario: ScenarioLike = option(help=SCENARIO, more=SCENARIO_MORE, argument=True, metavar="SCENARIO")
    log: ScenarioLike = option(help="A recorded scenario, likewise.", more=SCENARIO_MORE, argument=True, metavar="LOG")
    _: KW_ONLY
    instrument: Sequence[str] | str | None = option(
        "--instrument",
        default=None,
        help="Names of instruments, separated by commas, or imu; NAME=OTHER where the log has another name. Default: "
        "all but the imu.",
        cli=list[str] | None,
    )
    runs: int = option("--runs", "-n", default=12, least=3, help="Number of simulated runs.")
    seed: int = option(default=0, least=0, help="Seed of the first of them.")
