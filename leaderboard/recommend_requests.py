"""The request of `simnav.recommend`: which row to take?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY

from simnav.leaderboard.campaign.options import PathLike

from .calls import option, request
from .requests import ScenarioLike

__all__ = ["RecommendRequest"]


@request
class RecommendRequest:
    """Which estimator to take, for your instruments and the troubles that you fear, from stored results.

    Nothing is run. The answer says how sure it is, and where there is no evidence.
    """

    instruments: ScenarioLike | Sequence[str] = option(
        help="Kinds of instruments, like imu gnss dvl gyrocompass; or a scenario, by its name or its TOML file, also "
        "of a log: then its instruments.",
        argument=True,
        metavar="INSTRUMENT...",
        cli=list[str],
    )
    _: KW_ONLY
    troubles: Sequence[str] | str = option(
        "--trouble",
        "-t",
        default=(),
        cli=list[str] | None,
        read=lambda given: tuple(given or ()),
        metavar="TROUBLE",
        help="Kind of trouble to be feared: nothing, noisy-fixes, lying-fixes, outage, velocity, heading, datasheet, "
        "imu or several; repeatable. Default: those that one track has.",
        more="Several are a list, or a text with commas.",
    )
    milliseconds: float | None = option(
        default=None,
        least=0.0,
        help="Most time that an epoch may take, on the machine of the results.",
        more="It is the stored multiple of the plain row's processor time, times the plain row's median time.",
    )
    results: PathLike | None = option(
        "--results", default=None, help="Folder that a campaign wrote. Default: the result that comes with simnav."
    )
