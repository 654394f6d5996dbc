"""Output of the `simnav` command: tables, one JSON document for other programs, and short errors.

Results go to standard output; progress, warnings and errors go to standard error. With ``--json``
standard output holds exactly one JSON document, whatever estimators or libraries print meanwhile.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.errors import RequestError, sentence, shortened
from simnav.leaderboard.results.plain import as_json

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

    from simnav.watchers import Watcher

__all__ = ["Output", "ProgressBar", "session"]

USER, FAILED, INTERRUPTED = 2, 1, 130
CLAIMED = 3  # of verify: what was repeated holds, and something else is only claimed
_WIDTH_WITHOUT_TERMINAL = 150


class ProgressBar:
    """A live bar with time left on a terminal; a line every few seconds elsewhere.

    Parameters
    ----------
    console : rich.console.Console
        Of standard error.
    text : str
        The text beside the bar.
    total : int or None
        None while it is not known.
    """

    #: Between lines where there is no terminal [s].
    PAUSE = 5.0

    def __init__(self, console: Console, text: str, total: int | None = None):
        from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as Bar

        self._console = console
        self._text, self._total, self._done = text, total, 0
        self._start = self._said = time.monotonic()
        self._bar = Bar(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left {task.fields[left]}"),
            TextColumn("[dim]{task.fields[note]}"),
            console=console,
            refresh_per_second=5,
            disable=not console.is_terminal,
            transient=True,
            expand=True,
        )
        self._task = self._bar.add_task(text, total=total, note="", left="–")

    def __enter__(self) -> ProgressBar:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
        if not self._console.is_terminal and self._done:
            self._line("")

    def __call__(self, done: int, total: int | None = None, note: str = "", left: float | None = None) -> None:
        """Tell how many of how many are done, what was last, and the seconds left where the caller knows better."""
        self._done, self._total = done, self._total if total is None else total
        left_text = _clock(self.left() if left is None else left)
        self._bar.update(self._task, completed=done, total=self._total, note=note, left=left_text)
        now = time.monotonic()
        if not self._console.is_terminal and now - self._said >= self.PAUSE:
            self._said = now
            self._line(f", {left_text} left")

    def begin(self, text: str) -> None:
        """Another stage: its name, from nothing."""
        if text != self._text:
            self._text, self._done, self._total = text, 0, None
            self._start = self._said = time.monotonic()
            self._bar.remove_task(self._task)
            self._task = self._bar.add_task(text, total=None, note="", left="–")

    def left(self) -> float | None:
        """Seconds left by the mean pace so far, or None."""
        if not self._total or not self._done:
            return None
        return (time.monotonic() - self._start) * (self._total - self._done) / self._done

    def _line(self, tail: str) -> None:
        passed = _clock(time.monotonic() - self._start)
        of = "" if self._total is None else f"/{self._total}"
        self._console.print(f"{self._text}: {self._done}{of} in {passed}{tail}", highlight=False)


def _clock(seconds: float | None) -> str:
    if seconds is None:
        return "–"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


class Output:
    """The output of a command.

    Attributes
    ----------
    json : bool
        True where the user asked for one JSON document.
    code : int
        Exit code of a command that ends without an exception.
    """

    def __init__(self, json: bool = False, debug: bool = False):
        self.json, self.debug, self.code = json, debug, 0
        self._document: Any = None

    @staticmethod
    def _console(stderr: bool) -> Console:
        from rich.console import Console

        stream = sys.stderr if stderr else sys.stdout
        width = None if stream.isatty() or os.environ.get("COLUMNS") else _WIDTH_WITHOUT_TERMINAL
        return Console(stderr=stderr, width=width)

    def print(self, *what: RenderableType) -> None:
        """Print text; nothing with ``--json``."""
        if not self.json:
            console = self._console(stderr=False)
            for item in what:
                console.print(item, highlight=False, markup=False)

    def note(self, text: str) -> None:
        """Print a message on standard error."""
        self._console(stderr=True).print(text, highlight=False, markup=False, soft_wrap=True)

    def remark(self, text: str) -> None:
        """Print a message with the name of the command."""
        self.note(f"simnav: {text}")

    def progress(self, text: str, total: int | None = None) -> ProgressBar:
        """A progress display on standard error."""
        return ProgressBar(self._console(stderr=True), text, total)

    def reading(self) -> Watcher:
        """Tells every few seconds how far a log file has been read."""
        said = time.monotonic()

        def watcher(path: Path, done: int, total: int) -> None:
            nonlocal said
            if time.monotonic() - said >= ProgressBar.PAUSE and total > 0:
                said = time.monotonic()
                self.note(f"reading {path.name}: {100 * done // total} %")

        return watcher

    def compiling(self) -> None:
        """Say that what comes next takes its time, once."""
        self.remark(
            "compiling kernels; they are kept for later runs ('simnav warmup' compiles all, in a minute or two)"
        )

    def document(self, value: Any) -> None:
        """Set what ``--json`` prints when the command ends."""
        self._document = value

    def flush(self) -> None:
        """Print the JSON document, with ``--json``."""
        if self.json:
            sys.stdout.write(json.dumps(as_json(self._document), indent=2, allow_nan=False, ensure_ascii=False) + "\n")
            sys.stdout.flush()


@contextlib.contextmanager
def _quiet_stdout(active: bool) -> Iterator[None]:
    """Send to standard error whatever is printed, also by compiled libraries and child processes."""
    if not active:
        yield
        return
    real = sys.stdout is sys.__stdout__
    with contextlib.redirect_stdout(sys.stderr):
        if not real:
            yield
            return
        sys.__stdout__.flush()  # type: ignore[union-attr]
        saved = os.dup(1)
        os.dup2(2, 1)
        try:
            yield
        finally:
            sys.stderr.flush()
            os.dup2(saved, 1)
            os.close(saved)


@contextlib.contextmanager
def session(json: bool, debug: bool) -> Iterator[Output]:
    """Context of every command: prints its output and turns exceptions into exit codes.

    Raises
    ------
    typer.Exit
        2 after a user's mistake, 1 after a failure, 130 after an interruption.
    """
    import typer

    from simnav.watchers import announced, watched

    out = Output(json, debug)
    previous = warnings.showwarning

    def warn(message: Warning | str, category: type[Warning], *where: Any, **_: Any) -> None:
        out.remark(f"warning: {shortened(' '.join(str(message).split()))}")

    try:
        if not debug:
            warnings.showwarning = warn
        with _quiet_stdout(json), watched(out.reading()), announced(out.compiling):
            yield out
    except (typer.Exit, typer.Abort):
        raise
    except BrokenPipeError:
        raise typer.Exit(FAILED) from None
    except KeyboardInterrupt:
        out.remark("interrupted; what was finished is kept")
        raise typer.Exit(INTERRUPTED) from None
    except Exception as error:
        from simnav.spec import SpecError

        if debug:
            import traceback

            traceback.print_exc()
        mistake = isinstance(error, (RequestError, SpecError))
        text = sentence(error)
        module = type(error).__module__
        ours = module.startswith("simnav") and not module.startswith(
            "simnav.estimators"
        )  # their messages are sentences
        if not mistake and not ours and not isinstance(error, OSError):
            text = f"{type(error).__name__}: {text}" + ("" if debug else " (--debug shows where)")
        out.remark(text)
        code = USER if mistake else FAILED
        out.document({"error": text, "code": code})
        out.flush()
        raise typer.Exit(code) from None
    finally:
        warnings.showwarning = previous
    out.flush()
    if out.code:
        raise typer.Exit(out.code)
