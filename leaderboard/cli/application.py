"""The `simnav` command.

The module of a command is imported when the command runs, so that ``simnav list`` answers at once. Results go to
standard output, everything else to standard error; exit code 2 is a user's mistake, 1 a failure.
"""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from simnav.leaderboard.results.errors import shortened

from .commands import COMMANDS, GROUPS, HEADINGS, MOVED
from .console import USER, Output
from .derived import command, command_of_group

__all__ = ["app", "main"]


class _Root(TyperGroup):
    """The command: its commands in the order of their headings, and where those went that have another name now."""

    def list_commands(self, ctx: Any) -> list[str]:
        return [*_heading]

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args[0] in MOVED:
            ctx.fail(f"'simnav {args[0]}' is 'simnav {MOVED[args[0]]}' now")
        return super().resolve_command(ctx, args)


_heading = {name: heading for heading, names in HEADINGS.items() for name in names}
app = typer.Typer(
    name="simnav",
    cls=_Root,
    help="The open benchmark for marine integrated navigation: simulate, estimate, score, rank.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"simnav {version('simnav')}")
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
    plugin: Annotated[
        list[Path] | None,
        typer.Option(help="Python file that registers instruments, scores, formats or others; repeatable."),
    ] = None,
    figure_width: Annotated[
        float | None,
        typer.Option(min=50.0, max=1000.0, help="Width of figures that are written, in mm, such as 88 or 180."),
    ] = None,
) -> None:
    """The open benchmark for marine integrated navigation: simulate, estimate, score, rank."""
    if figure_width is not None:
        from simnav.leaderboard.figures.style import WIDTH

        WIDTH.set(figure_width)
    if plugin:
        from simnav.plugins import PluginError, load_plugin

        for path in plugin:
            try:
                load_plugin(path)
            except PluginError as error:
                text = str(error) if path.name in str(error) else f"{path.name}: {error}"
                raise typer.BadParameter(text, param_hint="--plugin") from None


def _add(to: typer.Typer, name: str, request: type[Any], home: str, **how: Any) -> None:
    """Add a command; where commands are listed, the first line of its help is shown."""
    run = command(request, home)
    to.command(name, short_help=(run.__doc__ or "").partition("\n")[0], **how)(run)


for _name in (name for name in COMMANDS if name not in GROUPS):
    _add(app, _name, *COMMANDS[_name], rich_help_panel=_heading[_name])
for _group, (_help, _commands) in GROUPS.items():
    _alone = COMMANDS.get(_group)
    _typer = typer.Typer(
        help=_help,
        no_args_is_help=_alone is None,
        invoke_without_command=_alone is not None,
        subcommand_metavar="COMMAND [ARGS]..." if _alone is None else "[COMMAND [ARGS]...]",
    )
    for _name, (_request, _home) in _commands.items():
        _add(_typer, _name, _request, _home)
    _typer.callback()((lambda: None) if _alone is None else command_of_group(*_alone))
    app.add_typer(_typer, name=_group, rich_help_panel=_heading[_group])


def _open_streams() -> None:
    """A stream that was closed before the start (``simnav list >&-``) takes what is printed, and keeps nothing.

    A terminal that knows fewer characters than are printed shows question marks for the others.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115
            setattr(sys, f"__{name}__", getattr(sys, name))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def main() -> None:
    """Entry point of the console script."""
    _open_streams()
    try:
        code = app(standalone_mode=False, prog_name="simnav")
    except Exception as error:  # of the parser: an unknown command or option, a value of the wrong type
        if not hasattr(error, "format_message"):
            raise
        words = " ".join(error.format_message().split()).replace(": Value error, ", ": ", 1)
        text = shortened(words) or "see simnav --help"
        out = Output(json="--json" in sys.argv[1:])
        out.remark(text)
        out.document({"error": text, "code": USER})
        out.flush()
        sys.exit(USER)
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(code if isinstance(code, int) else 0)
