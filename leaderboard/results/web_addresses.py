"""The web addresses of the repository and of the documentation of simnav, as far as they are known.

The metadata of the package name them (``[project.urls]``). In a checkout without them, the address is that of its
remote ``origin``, if it is one on the web; a path on this machine is nobody else's address.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, metadata
from os.path import relpath
from pathlib import Path

from .errors import RequestError

__all__ = ["BUILT", "NOWHERE", "Home", "home", "linked_from", "web_address"]

#: Folder of the built documentation (`make docs`), where none is named.
BUILT = "site-docs"

#: A remote as git takes it: with a scheme, or as ``git@host:owner/name``. What stands before "@" may be a secret.
_REMOTE = re.compile(
    r"(?:(?:https?|ssh|git)://(?:[^@/\s]*@)?(?P<host>[\w.-]+\.[a-z]{2,})(?::\d+)?/"
    r"|[\w.-]+@(?P<scp>[\w.-]+\.[a-z]{2,}):)(?P<path>[\w.~/-]+?)(?:\.git)?/?"
)
#: Hosts that show the files of the default branch below this part of the address.
_FILES = {"github.com": "blob/HEAD", "gitlab.com": "-/blob/HEAD"}


@dataclass(frozen=True)
class Home:
    """Addresses; empty where they are not known.

    Attributes
    ----------
    repository : str
        Web address of the repository.
    documentation : str
        First page of the documentation: a web address, or a path relative to a page that links to it.
    """

    repository: str = ""
    documentation: str = ""

    def page(self, name: str) -> str:
        """Address of a page of the documentation; empty where the documentation is not known.

        Parameters
        ----------
        name : str
            Its place without the ending, such as ``explanation/oracle``.

        Examples
        --------
        >>> Home(documentation="../site-docs/index.html").page("statistics")
        '../site-docs/statistics.html'
        >>> Home(documentation="https://example.org/simnav/").page("statistics")
        'https://example.org/simnav/statistics.html'
        """
        if not self.documentation:
            return ""
        found = re.fullmatch(r"(.*?)(?:/?index(\.\w+))?/?", self.documentation)
        folder, ending = found.groups() if found else (self.documentation, None)
        return f"{folder}/{name}{ending or '.html'}" if folder else f"{name}{ending or '.html'}"


#: Nothing is known.
NOWHERE = Home()


def web_address(remote: str) -> str:
    """Web address of a remote of git, without names and secrets; empty if it has none.

    Examples
    --------
    >>> web_address("git@example.org:navigation/simnav.git")
    'https://example.org/navigation/simnav'
    >>> web_address("/home/ana/simnav")
    ''
    """
    found = _REMOTE.fullmatch(remote.strip())
    return f"https://{found['host'] or found['scp']}/{found['path'].strip('/')}" if found else ""


@lru_cache(maxsize=1)
def home() -> Home:
    """The addresses of this installation."""
    named: dict[str, str] = {}
    try:
        for line in metadata("simnav").get_all("Project-URL") or ():
            label, _, address = line.partition(",")
            named[label.strip().lower()] = address.strip()
    except PackageNotFoundError:  # a copy on the path, not installed
        pass
    checkout = Path(__file__).resolve().parents[2]
    repository = named.get("repository") or named.get("source") or web_address(_origin(checkout))
    documentation = named.get("documentation", "")
    host = repository.removeprefix("https://").partition("/")[0]
    if not documentation and host in _FILES:
        documentation = f"{repository}/{_FILES[host]}/docs/index.md"
    return Home(repository, documentation)


def linked_from(site: Path, documentation: str = BUILT) -> Home:
    """The addresses as the pages of a site link to them.

    Parameters
    ----------
    site : Path
        Folder of the site.
    documentation : str
        Web address of the documentation, or the folder where it was built. Without the default folder, the
        documentation is where that of this installation is known to be.

    Raises
    ------
    RequestError
        If there is no documentation in the folder.
    """
    if re.match("https?://", documentation):
        return replace(home(), documentation=documentation)
    first = Path(documentation).expanduser().resolve() / "index.html"
    if first.is_file():
        return replace(home(), documentation=Path(relpath(first, site)).as_posix())
    if documentation != BUILT:
        raise RequestError(f"{documentation} has no index.html: it should be a folder that 'make docs' built, "
                           "or a web address")  # fmt: skip
    return home()


def _origin(folder: Path) -> str:
    """The remote ``origin`` of a checkout; empty where the folder is none."""
    if not (folder / ".git").exists():
        return ""
    command = ["git", "-C", str(folder), "config", "--get", "remote.origin.url"]
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=False).stdout
    except (OSError, subprocess.SubprocessError):
        return ""
