"""The request of `simnav.claim`: under which conditions does a claim hold?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.options import PathLike

from .calls import option, request
from .requests import ScenarioLike

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress
    from simnav.leaderboard.campaign.request import EstimatorLike

__all__ = ["ClaimRequest"]


@request
class ClaimRequest:
    """Under which conditions does a claim hold: one method is better than another by so much?

    A claim of a paper has a name. A claim of your own names an estimator, and with ``than``, ``scenario`` and ``gain``
    the rest. Each condition is varied by itself, on seeds of a search. What was found is judged on other seeds.
    """

    claim: str = option(
        default="",
        help="Name of a paper's claim, or the estimator that is claimed to be better.",
        more="The command without a name, or with the key of a paper, lists the claims.",
        argument=True,
        metavar="CLAIM",
    )
    _: KW_ONLY
    holds_if: Sequence[str] = option(
        "--holds-if",
        default=(),
        metavar="CONDITION",
        help="A choice that is varied, perhaps with values, like lag or lag=0,10,20; several are varied one by one. "
        "'all' varies all choices of a paper's claim. Default: the stored answer, and nothing is run; a claim of your "
        "own is judged as it stands.",
        more="Of a claim of your own: lag, row.PARAMETER, than.PARAMETER, both.PARAMETER, or a dial or key of the "
        "scenario, each with values.",
    )
    than: EstimatorLike | None = option(
        default=None, cli=str | None, help="For a claim of your own: the estimator that it is compared with."
    )
    scenario: ScenarioLike | None = option(
        "--scenario", "-s", default=None, help="For a claim of your own: name or TOML file of the scenario."
    )
    gain: float | None = option(default=None, help="For a claim of your own: by how many percent it is better.")
    score: str = option(default="horizontal_rmse", help="For a claim of your own: a score that is better when lower.")
    runs: int = option("--runs", "-n", default=6, help="Seeds of the search, for each value.", least=1)
    judged: int = option(
        default=12, help="First number of seeds of the judgement.", least=1,
        more="They are doubled while it is undecided, four times at most; the interval allows for that.",
    )  # fmt: skip
    judged_from: int = option(default=10000, help="First seed of the judgement.", least=0)
    output: PathLike | None = option(
        "--output", "-o", default=None, help="Folder of the results. Default: results/claims.",
        more="A later call continues there.",
    )  # fmt: skip
    workers: int = option(default=2, help="Number of processes.", least=1)
    progress: Callable[[str, Progress], None] | None = option(
        default=None, help="Called with what is being run and the campaign's progress.", hidden=True
    )
