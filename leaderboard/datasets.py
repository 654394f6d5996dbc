"""Calls for data sets of voyages to learn from: files, and streams of recordings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import count
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.options import PathLike
from simnav.leaderboard.results.errors import RequestError, mistakes

from .arguments import absolute, scenario_of
from .calls import call, whole_number
from .dataset.splits import OPEN, SPLITS, named_splits, require_family, require_key, sizes
from .dataset_requests import DatasetRequest
from .requests import ScenarioLike

if TYPE_CHECKING:
    from simnav.recording import Recording
    from simnav.scenario import Scenario

    from .dataset.making import DatasetReport

__all__ = ["dataset", "read_voyages", "voyages"]


@call(DatasetRequest)
def dataset(request: DatasetRequest) -> DatasetReport:
    """Write a data set.

    Returns
    -------
    simnav.leaderboard.dataset.making.DatasetReport
        What the folder holds, and how long it took.

    Raises
    ------
    RequestError
        If the family is unknown or ranked, there is no such split, a key is missing, or the folder holds something
        else: one sentence.
    """
    from simnav.leaderboard.campaign.seal import read_seal

    from .dataset.making import make

    family, workers = _family(request.family), whole_number("workers", request.workers, 1)
    wanted = sizes(whole_number("size", request.size, 1))
    seal = read_seal(request.sealed)
    by_default = SPLITS if seal.secret else OPEN
    splits = named_splits(by_default if request.splits is None else request.splits)
    require_key(splits, seal)
    asked = {split: wanted[split] for split in splits}
    return make(family, asked, absolute(request.output), seal, workers, request.progress)


def voyages(
    family: ScenarioLike, split: str = "train", numbers: Iterable[int] | None = None, *, sealed: PathLike | None = None
) -> Iterator[Recording]:
    """Simulate the voyages of a data set one after the other, without files.

    Parameters
    ----------
    family : str, Path or Scenario
        A training family.
    split : str
        ``train``, ``validation`` or ``test``. Recordings of the last have neither truth nor labels.
    numbers : iterable of int, optional
        Numbers of the voyages in the split. Default: 0, 1, 2 and so on, without end. Processes that share the work
        take ``itertools.count(number_of_this_process, number_of_processes)``.
    sealed : path, optional
        Key file from which the seeds of split ``test`` are derived; this split needs one.

    Returns
    -------
    iterator of Recording
        The same recordings as those in the files of `dataset`, which are rounded.

    Raises
    ------
    RequestError
        If the family is unknown or ranked, there is no such split, or a key is missing: one sentence.

    Examples
    --------
    >>> first = next(voyages("training-ships"))
    >>> first.duration, sorted(first.data.aids)
    (600.0, ['gnss', 'gyrocompass', 'speed_log'])
    """
    from simnav.leaderboard.campaign.seal import read_seal

    from .dataset.voyages import recordings

    found, name, seal = _family(family), _split(split), read_seal(sealed)
    require_key([name], seal)
    return recordings(found, name, count() if numbers is None else _whole(numbers), seal)


def read_voyages(folder: PathLike, split: str = "train", numbers: Iterable[int] | None = None) -> Iterator[Recording]:
    """Read the voyages of a data set that `dataset` wrote.

    Parameters
    ----------
    folder : path
        Its folder.
    split : str
        ``train``, ``validation`` or ``test``. Recordings of the last have neither truth nor labels.
    numbers : iterable of int, optional
        Numbers of the voyages in the split, in any order. Default: all.

    Returns
    -------
    iterator of Recording
        IMU samples and truth are rounded (`simnav.leaderboard.dataset.tables`).

    Raises
    ------
    RequestError
        If the folder holds no data set of this version, or the split or a voyage is not there: one sentence.
    """
    from .dataset.manifest import Manifest
    from .dataset.parts import read_recordings

    path, name = absolute(folder), _split(split)
    manifest = Manifest.read(path)
    if name not in manifest.sizes:
        raise RequestError(f"{path}: there is no split {name!r} in this data set, only {', '.join(manifest.sizes)}")
    wanted = range(manifest.sizes[name]) if numbers is None else _whole(numbers)
    return read_recordings(path, manifest.family, name, wanted)


def _family(given: ScenarioLike) -> Scenario:
    with mistakes():
        found = scenario_of(given)
    require_family(found)
    return found


def _split(given: str) -> str:
    found = named_splits([given])
    return found[0]


def _whole(numbers: Iterable[int]) -> Iterator[int]:
    return (whole_number("numbers", number) for number in numbers)
