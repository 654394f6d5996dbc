"""One file of a recording: its path, its format and its clock."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from simnav.log.same_time import SameTime
from simnav.log.units import check_dimension, check_units
from simnav.spec import Positive, Spec, quantity, without_later

__all__ = ["Column", "FileSpec"]

#: A column: its header, or its number counted from 1; a minus before it flips the sign; ``"=0.0"`` is a constant.
Column = int | str


class FileSpec(Spec):
    """One file of a recording, and its clock.

    Attributes
    ----------
    path : str
        Below the folder; ``{recording}`` stands for the recording's name.
    format : str
        ``csv`` is any table of numbers, with or without a header, separated by comma, semicolon, tab or blank; ``nmea``
        is NMEA 0183; others are registered (`simnav.log.reader`).
    time : int or str, or two of them
        CSV: the column of the time; or the columns of the date and of the time of day.
    time_unit : str
        CSV: unit of the time column, or ``iso`` for dates like ``2014-08-01T00:00:00.124Z``. Without a meaning for two
        columns.
    clock : {"logger", "sentence"}
        NMEA: the stamp that the logger put before each line, or the UTC time inside the sentence (a sentence without
        one has that of the last sentence before it in the file that has one).
    spacing : float or None
        True spacing of the rows [s], where the time column is not to be trusted: row k is at k times this.
    scale : float
        Multiplies the times.
    offset : float or tuple of float
        Added to the times, after ``scale`` or ``spacing`` [s]; one for each recording, or one for all.
    skip_lines : int
        CSV: lines above the header to leave out, or above the first row of a table without one.
    skip_rows : int
        CSV: rows after the header to leave out at the beginning, for example one of units.
    comment : str
        CSV: lines that begin with it are left out, wherever they stand.
    same_time : {"refuse", "first", "last", "spread"} or None
        What is done with rows that have the time of the row before: an error, the first or the last of them counts, or
        they are spread evenly up to the next time. None: ``first`` for NMEA, ``refuse`` for tables.
    options : dict
        Formats of others: what their reader wants to know.
    """

    path: str
    format: str = "csv"
    time: Column | tuple[Column, Column] = 1
    time_unit: str = "s"
    clock: Literal["logger", "sentence"] = "logger"
    spacing: Positive | None = quantity("s", None)
    scale: Positive = 1.0
    offset: float | tuple[float, ...] = quantity("s", 0.0)
    skip_lines: Annotated[int, Field(ge=0)] = 0
    skip_rows: Annotated[int, Field(ge=0)] = 0
    comment: str = ""
    same_time: SameTime | None = None
    options: dict[str, Any] = Field(default_factory=dict)

    @model_serializer(mode="wrap")
    def _without_empty(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """See `simnav.spec.without_later`."""
        return without_later(handler(self), {"options": {}, "same_time": None, "skip_lines": 0})

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.time_unit != "iso":
            check_units((self.time_unit,))
            check_dimension("time_unit", self.time_unit, "time")
        return self
