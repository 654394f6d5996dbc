"""Sealed seeds: runs that nobody can simulate before the key is published, and anybody can repeat afterwards.

The seed of a run is a keyed hash (BLAKE2b) of the scenario's id and the run's number. Results name the number and the
hash of the key, never the key or the seed.

A key file holds a secret that was drawn at random. Its **commitment**, a hash, is published before the campaign. A
second line ``public TEXT`` may mix in a value that nobody could choose, such as the numbers of a lottery drawn after
the commitment: then whoever made the secret did not choose the seeds either.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import secrets
import stat
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from simnav.leaderboard.results.errors import RequestError

from .sources import digest

__all__ = ["PUBLIC", "Seal", "make_key", "mix_public", "read_seal"]

_LEAST, _MOST = 16, 4096  # bytes of a secret
_LONGEST_PUBLIC = 1000
_BITS = 90.0  # that a secret should be worth by its frequencies; 32 random hexadecimal digits have about 110
_LETTERS = (b"[A-Z]", b"[a-z]", b"[0-9]")


@dataclass(frozen=True)
class Seal:
    """How the seeds of a campaign follow from the numbers of its runs: by a key, or as they are.

    Attributes
    ----------
    key : bytes
        32 bytes, from the content of the file; none for public seeds.
    file : Path, optional
        File of the key, which estimators must not read.
    committed : str
        Commitment to the secret, where a public value is mixed in.
    public : str
        The public value that is mixed in; empty where none is.
    """

    key: bytes = b""
    file: Path | None = None
    committed: str = ""
    public: str = ""

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
        return _hash(self.key)

    @property
    def commitment(self) -> str:
        """What is published before the campaign: a hash of the secret, before a public value was mixed in."""
        return self.committed or self.hash

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


def _hash(key: bytes) -> str:
    return hashlib.blake2b(key, digest_size=16, person=b"simnav seal").hexdigest()


def read_seal(path: str | os.PathLike[str] | None, *, secret: bool = True) -> Seal:
    """The seal of a key file, `PUBLIC` without one; white space at the ends of the file does not count.

    Parameters
    ----------
    path : path, optional
        File of the key.
    secret : bool
        Whether the key is still secret: then others must not be able to read the file, and the key should have been
        drawn at random. False for a key that was published.

    Raises
    ------
    RequestError
        If there is none, or it is no secret: one sentence.
    """
    if path is None:
        return PUBLIC
    file = Path(path).expanduser()
    content, mode = _content(file)
    words, public = _parted(content)
    if not _LEAST <= len(words) <= _MOST:
        raise RequestError(
            f"the key file {file} holds {len(words)} bytes; a key has {_LEAST} to {_MOST}, drawn at random"
        )
    if secret:
        if os.name == "posix" and mode & 0o077:
            raise RequestError(
                f"the key file {file} can be read by others (mode {mode:03o}); 'chmod 600 {file}' mends it"
            )
        if weakness := _weakness(words):
            raise RequestError(
                f"the key file {file} {weakness}; 'simnav campaign seal NEWFILE' makes one that is random"
            )
    key = hashlib.blake2b(words, digest_size=32, person=b"simnav key").digest()
    if not public:
        return Seal(key, file.resolve())
    mixed = hashlib.blake2b(public.encode(), digest_size=32, key=key, person=b"simnav public").digest()
    return Seal(mixed, file.resolve(), _hash(key), public)


def _content(file: Path) -> tuple[bytes, int]:
    """What a key file holds, and its mode."""
    try:
        with open(file, "rb") as opened:
            status = os.fstat(opened.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise RequestError(f"the key file {file} is no plain file")
            return opened.read(_MOST + _LONGEST_PUBLIC + 100).strip(), stat.S_IMODE(status.st_mode)
    except OSError as error:
        hint = f"; 'simnav campaign seal {file}' makes one" if isinstance(error, FileNotFoundError) else ""
        raise RequestError(f"the key file {file} cannot be read: {error.strerror}{hint}") from None


def _parted(content: bytes) -> tuple[bytes, str]:
    """The secret of a key file, and the public value on its second line."""
    found = re.fullmatch(rb"(\S+)\s*\npublic ([ -~]+)", content)
    return (found[1], found[2].decode()) if found else (content, "")


def _weakness(words: bytes) -> str:
    """Why bytes do not look as if they had been drawn at random; empty where they do.

    The entropy of the frequencies of the bytes, and of the differences of neighbours, is an upper limit of what they
    are worth. A period counts once. A text that is no hexadecimal number should have letters of both cases and digits,
    as base64 has: words have not.
    """
    n = len(words)
    period = next((p for p in range(1, n // 2 + 1) if words[p:] == words[:-p]), n)
    part = words[:period]
    steps = bytes((b - a) % 256 for a, b in pairwise(part))
    bits = min(_entropy(part), _entropy(steps) * len(part) / max(len(steps), 1))
    if bits < _BITS:
        return f"holds a key that is worth {abs(round(bits))} bits at most, and {_BITS:.0f} or more are wanted"
    hexadecimal = re.fullmatch(rb"[0-9a-fA-F]+", words)
    printable = re.fullmatch(rb"[\t-~]+", words)
    if printable and not hexadecimal and (b" " in words or not all(re.search(letters, words) for letters in _LETTERS)):
        return "holds words, not a number that was drawn at random"
    return ""


def _entropy(text: bytes) -> float:
    """Entropy of the frequencies of bytes [bit], of all of them together."""
    return -math.fsum(k * math.log2(k / len(text)) for k in Counter(text).values())


def make_key(path: str | os.PathLike[str]) -> Seal:
    """Make a key file that only its owner can read: 256 random bits.

    Parameters
    ----------
    path : path
        File, which should not exist yet.

    Raises
    ------
    RequestError
        If it exists, or cannot be written.
    """
    file = Path(path).expanduser()
    try:
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with open(descriptor, "w", encoding="ascii") as opened:
            opened.write(secrets.token_hex(32) + "\n")
    except FileExistsError:
        raise RequestError(f"{file} exists already; a key is never replaced") from None
    except OSError as error:
        raise RequestError(f"the key file {file} cannot be written: {error.strerror}") from None
    return read_seal(file)


def mix_public(path: str | os.PathLike[str], public: str) -> Seal:
    """Mix a public value into a key: the seeds then follow from both.

    Parameters
    ----------
    path : path
        File of a key whose commitment was published.
    public : str
        The value, as it was published after the commitment.

    Raises
    ------
    RequestError
        If the key has another one already, or the value is no line of printable ASCII.
    """
    file = Path(path).expanduser()
    text = " ".join(public.split())
    if not text or not text.isascii() or not text.isprintable() or len(text) > _LONGEST_PUBLIC:
        raise RequestError(f"public = {public!a:.80}: a line of printable ASCII is wanted")
    seal = read_seal(file)
    if seal.public == text:
        return seal
    if seal.public:
        raise RequestError(f"the key file {file} has the public value {seal.public!r:.80} already")
    content, _ = _content(file)
    if re.search(rb"\s", content):
        raise RequestError(
            f"the key file {file} holds white space; a public value is mixed into a key of one word only"
        )
    try:
        with open(file, "wb") as opened:  # it keeps its mode
            opened.write(content + f"\npublic {text}\n".encode())
    except OSError as error:
        raise RequestError(f"the key file {file} cannot be written: {error.strerror}") from None
    return read_seal(file)
