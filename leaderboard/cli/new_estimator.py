"""``simnav new-estimator``: a small estimator that works, to start from."""

from __future__ import annotations

import keyword
import re
from pathlib import Path
from shlex import quote

from simnav.estimator import names
from simnav.leaderboard.campaign.request import kebab as to_kebab
from simnav.leaderboard.results.errors import RequestError
from simnav.scenario.catalogue import headers

from .commands import NewEstimatorCommand
from .console import Output
from .options import absolute

__all__ = ["show", "write_estimator"]

_TEMPLATE = Path(__file__).parent / "estimator.py.jinja"


def show(out: Output, request: NewEstimatorCommand) -> None:
    """Write a small working estimator as a starting point."""
    kebab, path = write_estimator(request.name, request.output)
    out.document({"name": kebab, "file": str(path)})
    out.print(f"written: {path}", f"next:    simnav check {quote(path.name)}")


def write_estimator(name: str, output: Path | None = None) -> tuple[str, Path]:
    """Write a new estimator's file, never over an existing one; returns its registered name and the path.

    The name may be given as that of the file: ``my_filter.py`` is ``my-filter``.

    Raises
    ------
    RequestError
        If the name or the file will not do.
    """
    from jinja2 import Environment

    kebab = to_kebab(name.removesuffix(".py"))
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", kebab) or keyword.iskeyword(kebab):
        raise RequestError(f"{name!r} is no name for an estimator; it should be words like 'my-filter'")
    if kebab in names():
        raise RequestError(f"there is an estimator {kebab!r} already; choose another name")
    path = absolute(output or Path(kebab.replace("-", "_") + ".py"))
    if path.suffix != ".py":
        raise RequestError(f"--output {output}: the file should end in .py")
    scenarios = [h.name for h in headers()]
    text = Environment(keep_trailing_newline=True).from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
        name=kebab,
        class_name="".join(part.capitalize() for part in kebab.split("-")),
        file=path.name,
        scenario=next((s for s in scenarios if "open" in s), scenarios[0] if scenarios else "open-sea"),
    )  # fmt: skip
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise RequestError(f"{path} exists; choose another name, or --output") from None
    except FileNotFoundError:
        raise RequestError(f"there is no folder {path.parent}") from None
    return kebab, path
