"""What a folder of a data set holds: ``dataset.json``, for programs. A data set is never mixed with another one."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from simnav.leaderboard.campaign.seal import Seal
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.leaderboard.results.files import write_whole
from simnav.scenario import Scenario
from simnav.simulation.version import SIMULATOR_VERSION

from .splits import SPLITS, TEST, streams_of

__all__ = ["FILE", "FORMAT", "Manifest", "SplitReport"]

#: Version of the files of a data set. It is increased when their form changes.
FORMAT = 1
FILE = "dataset.json"


@dataclass(frozen=True)
class SplitReport:
    """A split of a data set.

    Attributes
    ----------
    voyages : int
        How many there are.
    duration : float
        Length of all of them together [s].
    size : int
        Of the files [bytes].
    """

    voyages: int
    duration: float
    size: int


@dataclass(frozen=True)
class Manifest:
    """What a data set is made of.

    Attributes
    ----------
    format : int
        `FORMAT`, when it was written.
    family : str
        Versioned id of the family.
    content : str
        Hash of what decides the numbers of the family's voyages.
    simulator : int
        Version of the simulator.
    sizes : dict of str to int
        Number of voyages of each split that was asked for.
    learned_from : dict of str to list of two int
        What an estimator tells that learned from a split (`simnav.estimator.Estimator.learned_from`).
    sealed : str
        Hash of the key of split ``test``; empty where its seeds are public.
    """

    format: int
    family: str
    content: str
    simulator: int
    sizes: dict[str, int]
    learned_from: dict[str, list[int]]
    sealed: str = ""

    @classmethod
    def begun(cls, folder: Path, family: Scenario, sizes: Mapping[str, int], seal: Seal) -> Manifest:
        """That of a data set which is to be made in a folder, or to be continued there; the larger size counts.

        Raises
        ------
        RequestError
            If the folder holds something else: other files, or a data set of another family, version or key.
        """
        sealed = seal.hash if TEST in sizes else ""
        if (folder / FILE).exists():
            old = cls.read(folder)
            for what, there, here in (
                ("family", old.family, family.id),
                ("version of the simulator", old.simulator, SIMULATOR_VERSION),
                ("content of the family's file", old.content, family.content_hash()),
            ):
                if there != here:
                    raise RequestError(
                        f"{folder}: {what} of the data set there is {there}, and not {here}; choose another folder"
                    )
            if {TEST} <= set(old.sizes) & set(sizes) and old.sealed != sealed:
                raise RequestError(
                    f"{folder}: the seeds of split {TEST} there are {_seeds(old.sealed)}, and not {_seeds(sealed)}; "
                    "choose another folder"
                )
            sizes = {s: max(old.sizes.get(s, 0), sizes.get(s, 0)) for s in SPLITS if s in {*old.sizes, *sizes}}
            sealed = sealed or old.sealed
        elif folder.is_dir() and any(folder.iterdir()):
            raise RequestError(f"{folder} holds other files; choose a new or an empty folder")
        learned = {split: list(streams_of(family, split, n)) for split, n in sizes.items() if split != TEST}
        return cls(FORMAT, family.id, family.content_hash(), SIMULATOR_VERSION, dict(sizes), learned, sealed)

    @classmethod
    def read(cls, folder: Path) -> Manifest:
        """That of a folder.

        Raises
        ------
        RequestError
            If the folder holds no data set, or one of another format.
        """
        path = folder / FILE
        if not path.is_file():
            raise RequestError(f"{folder} holds no data set: there is no {FILE}; 'simnav dataset' makes one")
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            if found["format"] != FORMAT:
                raise RequestError(
                    f"{path}: the data set has format {found['format']!r}, and this version of simnav reads format "
                    f"{FORMAT}; make it again, in another folder"
                )
            made = cls(**found)
            if not set(made.sizes) <= set(SPLITS) or not all(type(n) is int for n in made.sizes.values()):
                raise ValueError(f"sizes = {made.sizes!r}")
        except RequestError:
            raise
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise RequestError(f"{path}: not the description of a data set, or damaged ({error})") from None
        return made

    def write(self, folder: Path) -> None:
        """Write it, completely or not at all."""
        with mistakes(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            write_whole(folder / FILE, json.dumps(asdict(self), indent=1) + "\n")


def _seeds(sealed: str) -> str:
    return f"sealed by the key {sealed}" if sealed else "public"
