"""ZIP files of others: looked at before anything is unpacked, and unpacked within limits."""

from __future__ import annotations

import hashlib
import stat
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from simnav.leaderboard.results.errors import RequestError

__all__ = ["MOST_BYTES", "digest_of", "members", "opened", "unpack", "write_archive"]

#: Of all files of an archive together, unpacked [bytes].
MOST_BYTES = 256 << 20
#: Files in an archive.
MOST_FILES = 2000
_BLOCK = 1 << 20
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the same content gives the same archive


@contextmanager
def opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """A ZIP file.

    Raises
    ------
    RequestError
        If it cannot be read, or is none.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        raise RequestError(f"{path} is no whole ZIP file: {error}") from None
    except OSError as error:
        raise RequestError(f"{path} cannot be read: {error.strerror or error}") from None


def members(archive: zipfile.ZipFile, what: str) -> list[zipfile.ZipInfo]:
    """The files of an archive, all of which may be unpacked.

    Parameters
    ----------
    archive : ZipFile
        Open for reading.
    what : str
        Its name, for messages.

    Raises
    ------
    RequestError
        If a name leaves the folder or stands twice, a member is no plain file, or there is too much of them.
    """
    found, names, total = [], set[str](), 0
    infos = archive.infolist()
    if len(infos) > MOST_FILES:
        raise RequestError(f"{what} holds {len(infos)} files; at most {MOST_FILES} are taken")
    for info in infos:
        name = info.filename
        parts = PurePosixPath(name).parts
        printable = name.isprintable() and "\\" not in name and ":" not in name
        if not parts or not printable or name.startswith("/") or ".." in parts or name != unicodedata.normalize(
            "NFC", name
        ):  # fmt: skip
            raise RequestError(f"{what}: the name {name!r:.200} leads out of the folder, or is no plain name")
        if info.is_dir():
            continue
        mode = info.external_attr >> 16
        if mode and not stat.S_ISREG(mode) and stat.S_IFMT(mode):
            raise RequestError(f"{what}: {name} is no plain file (a link, for instance)")
        if info.flag_bits & 0x1:
            raise RequestError(f"{what}: {name} is encrypted")
        if name.casefold() in names:
            raise RequestError(f"{what}: {name} is in it twice")
        names.add(name.casefold())
        total += info.file_size
        if total > MOST_BYTES:
            raise RequestError(
                f"{what}: its files have more than {MOST_BYTES >> 20} MiB when they are unpacked, which is too much"
            )
        found.append(info)
    return found


def unpack(archive: zipfile.ZipFile, what: str, folder: Path) -> dict[str, Path]:
    """Unpack all files into a folder; returns their paths by name.

    Raises
    ------
    RequestError
        As `members`; also if a file has not the size or the check sum that the archive states.
    """
    found = {}
    for info in members(archive, what):
        target = folder.joinpath(*PurePosixPath(info.filename).parts)
        left = info.file_size
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(info) as source, open(target, "xb") as file:
                while block := source.read(_BLOCK):
                    left -= len(block)
                    if left < 0:
                        raise RequestError(f"{what}: {info.filename} is longer than the archive states")
                    file.write(block)
        except (zipfile.BadZipFile, zlib.error, NotImplementedError, EOFError, ValueError) as error:
            if isinstance(error, RequestError):
                raise
            raise RequestError(f"{what}: {info.filename} cannot be unpacked: {error}") from None
        except OSError as error:  # a file where another member wants a folder, a name that is too long
            raise RequestError(f"{what}: {info.filename} cannot be unpacked: {error.strerror or error}") from None
        found[info.filename] = target
    return found


def write_archive(path: Path, files: dict[str, Path | bytes]) -> None:
    """Write an archive; the same files give the same bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(files.items()):
            info = zipfile.ZipInfo(name, _EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = (stat.S_IFREG | 0o644) << 16
            archive.writestr(info, content if isinstance(content, bytes) else content.read_bytes())


def digest_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
