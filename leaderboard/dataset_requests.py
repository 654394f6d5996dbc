"""The requests of the calls for data sets."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import KW_ONLY

from simnav.leaderboard.campaign.options import PathLike

from .calls import option, request
from .requests import PROGRESS, Bar, ScenarioLike

__all__ = ["DatasetRequest"]


@request
class DatasetRequest:
    """Write recordings of random voyages to learn from, as Parquet, in splits train, validation and test.

    Truth and labels of split test are not written, and its seeds follow from a key, so that nobody else can simulate
    them. What is there is kept: started again, the call continues, also with
    a larger size.
    """

    family: ScenarioLike = option(
        help="A training family: a name or a TOML file.",
        more="Or the `simnav.scenario.Scenario` itself.",
        argument=True,
        metavar="FAMILY",
    )
    output: PathLike = option(
        "--output", "-o", metavar="FOLDER", help="Folder to write: new, empty, or a data set to continue."
    )
    _: KW_ONLY
    size: int = option(
        default=1000,
        help="Voyages of split train; validation and test have a tenth of that, at least one.",
        least=1,
    )
    splits: str | Iterable[str] | None = option(
        "--split",
        default=None,
        cli=str,
        metavar="NAMES",
        help="Splits to write, separated by commas; by default train and validation, and test with a key.",
    )
    sealed: PathLike | None = option(
        "--sealed",
        default=None,
        metavar="KEYFILE",
        help="Key file from which the seeds of split test are derived; there is no such split without one.",
    )
    workers: int = option(default=2, help="Number of processes.", least=1)
    progress: Bar = option(default=None, help=PROGRESS, hidden=True)
