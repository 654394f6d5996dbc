"""Instruments with channels, taken apart: a solver uses each channel as an instrument of its own.

A receiver of satellites or a DVL of four beams gives several independent readings at one time, one for each channel
(`simnav.kinds.Datasheet.channels`). Every solver takes them one by one. Its instruments are then the sources of
readings (`simnav.types.Measurement.source`): ``dvl:1``, ``dvl:2`` and so on, each with the datasheet of the instrument,
so each has its own test, weight, flag, noise and biases. The blocks of states that the instrument brings along
(`simnav.blocks`) belong to the instrument: all its channels depend on the same ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

from simnav.recording import AidStream
from simnav.types import Array, Datasheet, Instruments, Measurement

__all__ = ["ChannelDatasheet", "by_channel", "instrument_of", "of_channels", "owners", "reading_of", "summary", "whole"]


@dataclass(frozen=True, eq=False)
class ChannelDatasheet(Datasheet):
    """The datasheet of one channel; its name is the source of the readings, ``INSTRUMENT:CHANNEL``.

    Attributes
    ----------
    instrument : str
        Name of the instrument.
    channel : str
        Which of its channels it is.
    siblings : tuple of str
        All its channels.
    """

    instrument: str = ""
    channel: str = ""
    siblings: tuple[str, ...] = ()

    def __deepcopy__(self, memo: object) -> ChannelDatasheet:
        """Itself: it never changes, and an estimator that takes late readings is copied in each step."""
        return self


_FIELDS = tuple(field.name for field in fields(Datasheet))


def by_channel(instruments: Instruments) -> Instruments:
    """The instruments, with each channel as an instrument of its own; unchanged if none has channels."""
    if not any(sheet.channels for sheet in instruments.values()):
        return instruments
    sheets = [one for sheet in instruments.values() for one in _apart(sheet)]
    return Instruments(sheets, instruments.imu, instruments.step)


def _apart(sheet: Datasheet) -> list[Datasheet]:
    if not sheet.channels:
        return [sheet]
    fields = {name: getattr(sheet, name) for name in _FIELDS if name not in ("name", "channels")}
    return [
        ChannelDatasheet(
            f"{sheet.name}:{channel}", instrument=sheet.name, channel=channel, siblings=sheet.channels, **fields
        )
        for channel in sheet.channels
    ]


def reading_of(measurement: Measurement) -> Measurement:
    """The measurement of a channel as one of an instrument of its own; its side information stays with it."""
    m = measurement
    name = f"{m.instrument}:{m.channel}" if m.channel else m.instrument
    return Measurement(m.time, name, m.kind, m.value, "", m.side)


def of_channels(stream: AidStream) -> list[AidStream]:
    """The recorded readings of each channel of an instrument, named after their source; itself without channels."""
    if not stream.channels:
        return [stream]
    found = []
    for c, channel in enumerate(stream.channels):
        rows = stream.channel == c
        part = AidStream(
            f"{stream.name}:{channel}", stream.kind, stream.time[rows], stream.value[rows], stream.faults[rows],
            stream.fault_error[rows], stream.sigma[rows], stream.dropped[stream.dropped_channel == c],
        )  # fmt: skip
        found.append(part)
    return found


def instrument_of(sheet: Datasheet) -> str:
    """The name of the instrument that a datasheet belongs to."""
    return sheet.instrument if isinstance(sheet, ChannelDatasheet) else sheet.name


def whole(sheet: Datasheet) -> Datasheet:
    """The datasheet of the instrument that a channel belongs to, as the kind's functions receive it."""
    if not isinstance(sheet, ChannelDatasheet):
        return sheet
    fields = {name: getattr(sheet, name) for name in _FIELDS if name not in ("name", "channels")}
    return Datasheet(sheet.instrument, channels=sheet.siblings, **fields)


def owners(instruments: Instruments) -> dict[str, str]:
    """The instrument of each source that is a channel; empty if there are no channels."""
    return {s.name: s.instrument for s in by_channel(instruments).values() if isinstance(s, ChannelDatasheet)}


def summary(
    diagnostics: Mapping[str, float | Array], owner: Mapping[str, str], labels: dict[str, str] | None = None
) -> dict[str, float | Array]:
    """The diagnostics of channels, ``QUANTITY.INSTRUMENT:CHANNEL``, as one of their instrument: the mean over them.

    Channels that say nothing (NaN) do not count. The result holds no other diagnostics.

    Parameters
    ----------
    diagnostics : mapping of str to float or array
        All diagnostics of a step.
    owner : mapping of str to str
        The result of `owners`.
    labels : dict of str to str, optional
        The label of the mean for each label so far, empty for those that are not of a channel; a caller that keeps it
        from step to step saves time.
    """
    found: dict[str, list[float]] = {}
    labels = {} if labels is None else labels
    for label, value in diagnostics.items():
        mean = labels.get(label)
        if mean is None:
            quantity, _, source = label.partition(".")
            mean = labels[label] = f"{quantity}.{owner[source]}" if source in owner else ""
        if mean and isinstance(value, (int, float)):
            known = found.get(mean)
            if known is None:
                known = found[mean] = []
            if value == value:  # it is not NaN
                known.append(float(value))
    return {label: sum(known) / len(known) if known else float("nan") for label, known in found.items()}
