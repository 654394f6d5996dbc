"""A command of the command line from its request (`simnav.leaderboard.calls`): options, help, and what is run."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from simnav.leaderboard.calls import UNSET, option_of, options_of
from simnav.leaderboard.results.errors import RequestError

from .console import session

__all__ = ["command", "command_of_group", "parameters", "requested"]

_Json = Annotated[bool, typer.Option("--json", help="Print one JSON document, for machines.")]
_Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


def parameters(given: Sequence[str] | None) -> dict[str, str]:
    """The values of ``--set``.

    >>> parameters(["window=10", "spacing = 1"])
    {'window': '10', 'spacing': '1'}
    """
    values = {}
    for text in given or ():
        name, equals, value = text.partition("=")
        if not equals or not name.strip().isidentifier():
            raise RequestError(f"--set {text}: it should be name=value, like --set window=10")
        values[name.strip()] = value.strip()
    return values


def _texts(given: Sequence[str] | None) -> tuple[str, ...]:
    return tuple(given or ())


#: Annotation of a field -> type on the command line, and what makes the value of the field from what was given.
_TYPES: dict[str, tuple[Any, Callable[[Any], Any] | None]] = {
    "bool": (bool, None),
    "int": (int, None),
    "int | None": (int | None, None),
    "float": (float, None),
    "float | None": (float | None, None),
    "str": (str, None),
    "str | None": (str | None, None),
    "Path": (Path, None),
    "Path | None": (Path | None, None),
    "PathLike": (Path, None),
    "PathLike | None": (Path | None, None),
    "ScenarioLike": (str, None),
    "ScenarioLike | None": (str | None, None),
    "EstimatorLike": (str, None),
    "Scenarios": (list[str] | None, None),
    "Estimators": (list[str] | None, None),
    "Sequence[str]": (list[str] | None, _texts),
    "Parameters": (list[str] | None, parameters),
}


def _shown(request: type[Any]) -> list[Field[Any]]:
    """The fields of a request that are on the command line."""
    return [f for f in options_of(request) if not option_of(f).hidden]


def _parameter(declared: Field[Any]) -> inspect.Parameter:
    """A field as typer reads it."""
    told = option_of(declared)
    kind = told.cli if told.cli is not None else _TYPES[str(declared.type)][0]
    default = declared.default if told.cli_default is UNSET else told.cli_default
    if default == ():
        default = None
    if kind in (Path, Path | None) and isinstance(default, str):
        default = Path(default)
    how: dict[str, Any] = {"help": told.help, "metavar": told.metavar}
    if told.least is not None:
        how["min"] = told.least
    if told.argument:
        made = typer.Argument(**how, show_default=default is not None)
    else:
        made = typer.Option(*told.flags, **how)
    return inspect.Parameter(
        declared.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=inspect.Parameter.empty if default is MISSING else default,
        annotation=Annotated[kind, made],
    )


def requested(request: type[Any], given: dict[str, Any]) -> Any:
    """The request from what the command line gave."""
    values = {}
    for f in _shown(request):
        told, value = option_of(f), given[f.name]
        read = told.read or (_TYPES[str(f.type)][1] if str(f.type) in _TYPES else None)
        values[f.name] = value if read is None else read(value)
    return request(**values)


def command(request: type[Any], home: str) -> Callable[..., None]:
    """The function of a command, as typer takes it.

    Parameters
    ----------
    request : type
        The request. Its fields are the options, and the first paragraph of its docstring is the help.
    home : str
        Module whose function ``show`` runs the command and prints what came of it. It is imported when the command
        runs, so that ``simnav list`` answers at once: the modules of commands import all that they need at their top.
    """

    def run(**given: Any) -> None:
        with session(given["json"], given["debug"]) as out:
            made = requested(request, given)
            import_module(f"simnav.leaderboard.cli.{home}").show(out, made)

    taken = [_parameter(f) for f in _shown(request)]
    taken.sort(key=lambda p: not _is_argument(request, p.name))
    taken += [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
        for name, kind in (("json", _Json), ("debug", _Debug))
    ]
    vars(run)["__signature__"] = inspect.Signature(taken)
    run.__annotations__ = {p.name: p.annotation for p in taken}
    run.__doc__ = (request.__doc__ or "").partition("\n\n")[0]
    return run


def command_of_group(request: type[Any], home: str) -> Callable[..., None]:
    """The function of a group that is a command itself: it runs where no command of the group is named.

    Parameters
    ----------
    request : type
        As of `command`; without arguments, which the parser would take for commands.
    home : str
        As of `command`.
    """
    run = command(request, home)

    def alone(context: typer.Context, **given: Any) -> None:
        named = context.invoked_subcommand
        if named is None:
            run(**given)
            return
        for parameter in context.command.params:
            source = context.get_parameter_source(parameter.name or "")
            if source is not None and source.name == "COMMANDLINE":
                where = f"{context.command_path} {named}"
                raise typer.BadParameter(
                    f"options of '{where}' stand after it", param_hint=max(parameter.opts, key=len)
                )

    own = inspect.Parameter("context", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context)
    vars(alone)["__signature__"] = inspect.Signature([own, *inspect.signature(run).parameters.values()])
    alone.__annotations__ = {"context": typer.Context, **run.__annotations__}
    alone.__doc__ = run.__doc__
    return alone


def _is_argument(request: type[Any], name: str) -> bool:
    return option_of(request.__dataclass_fields__[name]).argument
