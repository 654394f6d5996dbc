"""Errors of requests: one class of error, and exceptions as sentences."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

__all__ = ["MOST_RUNS", "RequestError", "StoreError", "mistakes", "named", "printable", "sentence", "shortened"]

#: Most runs of an estimator on a scenario: a larger number is a mistake, and lists of so many seeds fill the memory.
MOST_RUNS = 1_000_000
_MOST = 1000  # characters of a message


class RequestError(ValueError):
    """A request cannot be carried out; the message is one sentence that says what would be right."""


class StoreError(RuntimeError):
    """A results folder that cannot be used; the message is one sentence."""


@contextlib.contextmanager
def mistakes(*kinds: type[Exception]) -> Iterator[None]:
    """Turn exceptions of the given kinds (by default those of wrong input) into `RequestError`."""
    expected = kinds or (ValueError, LookupError, TypeError, OSError, SyntaxError, ImportError, AttributeError)
    try:
        yield
    except RequestError:
        raise
    except expected as error:
        raise RequestError(sentence(error)) from error


def sentence(error: BaseException) -> str:
    """The message of an exception on one line."""
    if isinstance(error, KeyError) and error.args:
        text = str(error.args[0])  # str(KeyError) is the repr of its message
    elif isinstance(error, OSError) and error.strerror:
        text = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    elif isinstance(error, SyntaxError) and error.filename:
        text = f"{error.filename}, line {error.lineno}: {error.msg}"
    else:
        text = str(error)
    return shortened(printable(" ".join(text.split()))) or type(error).__name__


def named(error: BaseException) -> str:
    """The class of an exception, and its message where it has one that can be had."""
    try:
        text = str(error)
    except Exception:
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def printable(text: str) -> str:
    """A text of others without what a terminal or a browser would obey: colours, cursor, direction of writing.

    >>> printable("red \\x1b[31m, reversed \\u202e")
    'red \\\\x1b[31m, reversed \\\\u202e'
    """
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def shortened(text: str) -> str:
    """A message that repeats a long input: its begin and its end.

    >>> shortened("a" * 10_000).count("a")
    900
    """
    return text if len(text) <= _MOST else f"{text[:700]} ... {text[-200:]}"
