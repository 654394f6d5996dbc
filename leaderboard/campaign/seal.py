"""Sealed seeds: runs that nobody can simulate before the key is published, and anybody can repeat afterwards.

The seed of a run is a keyed hash (BLAKE2b) of the scenario's id and the run's number. Results name the number and the
hash of the key, never the key or the seed.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

from simnav.leaderboard.campaign.sources import digest
from simnav.leaderboard.results.errors import RequestError

__all__ = ["PUBLIC", "Seal", "read_seal"]

_LEAST, _MOST = 16, 4096  # bytes of a key file


@dataclass(frozen=True)
class Seal:
    """How the seeds of a campaign follow from the numbers of its runs: by a key, or as they are.

    Attributes
    ----------
    key : bytes
        32 bytes, from the content of the file; none for public seeds.
    file : Path, optional
        File of the key, which estimators must not read.
    """

    key: bytes = b""
    file: Path | None = None

    def __repr__(self) -> str:
        return f"Seal({self.hash})"  # a key in a traceback would be a key that is published

    @property
    def secret(self) -> bool:
        """Whether the seeds are sealed."""
        return bool(self.key)

    @property
    def hash(self) -> str:
        """What results carry: a hash of the key from which it cannot be found; empty for public seeds."""
        if not self.secret:
            return ""
        return hashlib.blake2b(self.key, digest_size=16, person=b"simnav seal").hexdigest()

    def recording(self, known: str) -> str:
        """The digest of the recordings of a scenario, from that of its public ones."""
        return digest(known, "sealed", self.hash) if self.secret else known

    def seed(self, scenario: str, number: int) -> int:
        """The seed of a run.

        Parameters
        ----------
        scenario : str
            Versioned id.
        number : int
            That takes the place of a seed in the results.
        """
        if not self.secret:
            return number
        h = hashlib.blake2b(f"{scenario}/{number}".encode(), digest_size=8, key=self.key, person=b"simnav seed")
        return int.from_bytes(h.digest()) >> 1

    def unreadable(self, folder: Path) -> tuple[Path, ...]:
        """What estimators must not read: the folder of the results with the trials that are kept, and the key."""
        return (folder,) if self.file is None else (folder, self.file)


#: Of a campaign that is not sealed.
PUBLIC = Seal()


def read_seal(path: str | os.PathLike[str] | None) -> Seal:
    """The seal of a key file, `PUBLIC` without one; white space at the ends of the file does not count.

    Raises
    ------
    RequestError
        If there is none, or it is too short to be a secret: one sentence.
    """
    if path is None:
        return PUBLIC
    file = Path(path).expanduser()
    try:
        with open(file, "rb") as opened:
            content = opened.read(_MOST + 1).strip()
    except OSError as error:
        hint = f"; 'openssl rand -hex 32 > {file}' makes one" if isinstance(error, FileNotFoundError) else ""
        raise RequestError(f"the key file {file} cannot be read: {error.strerror}{hint}") from None
    if not _LEAST <= len(content) <= _MOST:
        raise RequestError(
            f"the key file {file} holds {len(content)} bytes; a key has {_LEAST} to {_MOST}, drawn at random"
        )
    return Seal(hashlib.blake2b(content, digest_size=32, person=b"simnav key").digest(), file.resolve())
