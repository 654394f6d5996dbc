"""What a submission may require: packages by name, from the index of whoever installs them.

A requirement of others is handed to ``pip``. ``pip`` also takes URLs, paths, archives and options, and whatever stands
there is built, which runs its code. So only ``name[extras]specifier`` passes.
"""

from __future__ import annotations

from packaging.requirements import InvalidRequirement, Requirement

from simnav.leaderboard.results.errors import RequestError

__all__ = ["here", "requirement"]

_LONGEST = 200
#: Ends of names that pip takes for an archive in the working directory.
_ARCHIVES = (".whl", ".zip", ".tar", ".gz", ".tgz", ".bz2", ".tbz", ".xz", ".txz", ".tlz", ".lz", ".lzma", ".egg")


def requirement(text: str) -> str:
    """A requirement of others in its plain form.

    Parameters
    ----------
    text : str
        As in ``bundle.json``.

    Returns
    -------
    str
        ``name[extras]specifier``.

    Raises
    ------
    RequestError
        If it is anything else: a direct reference, a path, a URL, a marker, an option. One sentence.

    Examples
    --------
    >>> requirement("torch >= 2.6")
    'torch>=2.6'
    >>> requirement("evil @ file:///tmp/evil")
    Traceback (most recent call last):
    simnav.leaderboard.results.errors.RequestError: requires = 'evil @ file:///tmp/evil' names an address; only name[extras]specifier is taken, such as torch>=2.6
    """  # noqa: E501
    what = f"requires = {text!a:.200}"
    taken = "only name[extras]specifier is taken, such as torch>=2.6"
    if len(text) > _LONGEST or not (text.isascii() and text.isprintable()):
        raise RequestError(f"{what} is no printable text of up to {_LONGEST} characters; {taken}")
    try:
        found = Requirement(text)
    except InvalidRequirement:
        raise RequestError(f"{what} is no requirement of a package; {taken}") from None
    if found.url is not None:
        raise RequestError(f"{what} names an address; {taken}")
    if found.marker is not None:
        raise RequestError(f"{what} has a marker; {taken}")
    if any(s.operator == "===" for s in found.specifier) or found.name.lower().endswith(_ARCHIVES):
        raise RequestError(f"{what} is no name of a package with versions; {taken}")
    extras = f"[{','.join(sorted(found.extras))}]" if found.extras else ""
    return f"{found.name}{extras}{found.specifier}"


def here(text: str) -> str:
    """A requirement of an installed package, without its marker; empty where the marker does not hold here.

    Raises
    ------
    RequestError
        If others could not take it (`requirement`).
    """
    try:
        found = Requirement(text)
    except InvalidRequirement:
        return requirement(text)  # which says so
    if found.marker is not None:
        if not found.marker.evaluate({"extra": ""}):
            return ""
        found.marker = None
    return requirement(str(found))
