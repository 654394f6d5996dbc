"""How a real log is described: the ``[log]`` table of a recorded scenario.

Files give columns (CSV) or sentences (NMEA 0183) with a clock; channels pick columns of a file, with sign, order and
unit; the IMU, the aiding instruments and the reference are channels. Nothing here reads a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from simnav.log.files import Column, FileSpec
from simnav.log.reader import READERS
from simnav.log.row_filter import RowFilter
from simnav.log.units import check_dimension, check_units
from simnav.spec import NonNegative, Positive, Spec, Vector, closest, quantity, without_later

__all__ = [
    "TO_FILL_IN",
    "ChannelSpec",
    "FileSpec",
    "LogImuSpec",
    "LogInstrumentSpec",
    "OriginSpec",
    "RecordedSpec",
    "ReferenceSpec",
]

#: What stands in a scenario that `simnav.log.draft` could not complete.
TO_FILL_IN = "FILL IN"

_Every = Annotated[int, Field(ge=1)]
_LEVEL: Vector = (0.0, 0.0, 0.0)


class _Grown(Spec):
    """Base of specifications that have got more keys; see `without_later`."""

    later: ClassVar[Mapping[str, Any]] = {}

    @model_serializer(mode="wrap")
    def _without_later(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return without_later(handler(self), self.later)


#: The keys that channels got later, with their defaults.
_OF_CHANNELS: Mapping[str, Any] = {
    "offset": 0.0,
    "where": "",
    "mounting": _LEVEL,
    "drop_repeated": False,
    "variation": None,
    "variation_model": None,
    "first": 0,
    "sigma": (),
    "sigma_units": (),
    "sigma_times": 1.0,
}


class ChannelSpec(_Grown):
    """Columns of a file, in the order that the instrument wants them.

    Attributes
    ----------
    file : str
        A key of ``[log.files]``.
    sentence, talker : str or None
        NMEA: e.g. ``GGA`` and ``GP``; of a proprietary sentence all up to its first number, e.g. ``PSXN,23``.
    columns : tuple
        Names or numbers (from 1), ``-`` before a name flips its sign, ``"=0"`` is a constant; empty for what the
        sentence holds of this instrument. An attitude has roll, pitch and yaw, or the four columns of the quaternion
        that turns body axes to those of the frame, scalar first (Hamilton's; of its inverse, as JPL writes it, with
        ``-`` before the last three).
    units : str or tuple of str
        Of the columns, one or one each (keys of `LOG_UNITS`, also with a factor before, like ``"1e-7 deg"``); SI and
        radians where left out, as in NMEA sentences once they are read.
    frame : {"geodetic", "enu", "ned"}
        Of a position: latitude, longitude, height, or local Cartesian around ``[log.origin]``. Of a heading and of
        roll, pitch, yaw ``enu``: those of axes forward, left, up in east, north, up; yaw counts from east,
        anticlockwise.
    every : int
        Take only the rows 0, every, 2 every, ...
    hold_out : int or None
        Leave out the rows 0, hold_out, 2 hold_out, ...
    offset : float
        Added to the times, after that of the file: the delay of this instrument, negative if it is late [s].
    where : str
        Only rows that fulfil this condition count, like ``Q == 1 and sdn < 0.5`` (`simnav.log.row_filter`).
    mounting : (float, float, float)
        Roll, pitch, yaw of the instrument in the vessel [rad]: its readings are turned to the axes of the vessel. For
        velocities in body axes and, by the yaw, for headings.
    drop_repeated : bool
        Leave out rows whose values are all those of the row before: a logger that repeats the last value.
    variation : float or None
        Magnetic variation that is added to a magnetic heading [rad], positive east. None: that of the sentences.
    variation_model : str or None
        ``wmm``: the variation is that of the World Magnetic Model at the place and time of the reference.
    first : int
        With ``every`` and ``hold_out``: the first of the rows that are taken, or left out.
    sigma : tuple
        Columns with the standard deviation of each reading (``sdn``, ``fom``, ``hdop``): one for all components, or one
        each. A row that has none, or none above 0, has that of the datasheet.
    sigma_units : str or tuple of str
        Their units, like ``units``; of a figure without a unit, such as HDOP, leave it out.
    sigma_times : float or tuple of float
        Multiplies them: of HDOP the sigma at HDOP 1 [SI units].
    """

    later: ClassVar[Mapping[str, Any]] = _OF_CHANNELS

    file: str
    sentence: str | None = None
    talker: str | None = None
    columns: tuple[Column, ...] = ()
    units: str | tuple[str, ...] = ()
    frame: Literal["geodetic", "enu", "ned"] = "geodetic"
    every: _Every = 1
    hold_out: Annotated[int, Field(ge=2)] | None = None
    offset: float = quantity("s", 0.0)
    where: str = ""
    mounting: Vector = quantity("deg", _LEVEL)
    drop_repeated: bool = False
    variation: float | None = quantity("deg", None)
    variation_model: Literal["wmm"] | None = None
    first: Annotated[int, Field(ge=0)] = 0
    sigma: tuple[Column, ...] = ()
    sigma_units: str | tuple[str, ...] = ()
    sigma_times: Positive | tuple[Positive, ...] = 1.0

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.where:
            RowFilter(self.where)
        if self.variation is not None and self.variation_model is not None:
            raise ValueError("variation_deg and variation_model exclude each other; give one")
        check_units((self.units,) if isinstance(self.units, str) else self.units)
        check_units((self.sigma_units,) if isinstance(self.sigma_units, str) else self.sigma_units)
        for key, given in (("sigma_units", self.sigma_units), ("sigma_times", self.sigma_times)):
            if given not in ((), 1.0) and not self.sigma:
                raise ValueError(f"{key} needs 'sigma', the columns of the standard deviations")
            if isinstance(given, tuple) and len(given) not in (0, len(self.sigma)):
                raise ValueError(
                    f"{key} has {len(given)} values for {len(self.sigma)} columns of sigma; give one or each"
                )
        if isinstance(self.units, tuple) and len(self.units) not in (0, len(self.columns)):
            raise ValueError(
                f"{len(self.units)} units for {len(self.columns)} columns; give one unit, or one for each column"
            )
        return self


class LogInstrumentSpec(_Grown):
    """Where the measurements of one aiding instrument come from.

    Attributes
    ----------
    source : {"file", "reference"}
        ``reference``: simulated from the reference with the instrument's own error model.
    file, sentence, talker, columns, units, frame, every, hold_out, offset, where, mounting, drop_repeated, variation,
    variation_model, first, sigma, sigma_units, sigma_times
        As in `ChannelSpec`, for ``source = "file"``.
    """

    later: ClassVar[Mapping[str, Any]] = _OF_CHANNELS

    source: Literal["file", "reference"] = "file"
    file: str | None = None
    sentence: str | None = None
    talker: str | None = None
    columns: tuple[Column, ...] = ()
    units: str | tuple[str, ...] = ()
    frame: Literal["geodetic", "enu", "ned"] = "geodetic"
    every: _Every = 1
    hold_out: Annotated[int, Field(ge=2)] | None = None
    offset: float = quantity("s", 0.0)
    where: str = ""
    mounting: Vector = quantity("deg", _LEVEL)
    drop_repeated: bool = False
    variation: float | None = quantity("deg", None)
    variation_model: Literal["wmm"] | None = None
    first: Annotated[int, Field(ge=0)] = 0
    sigma: tuple[Column, ...] = ()
    sigma_units: str | tuple[str, ...] = ()
    sigma_times: Positive | tuple[Positive, ...] = 1.0

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.source == "file":
            self.channel()
        elif self.file is not None or self.columns:
            raise ValueError("source = 'reference' reads no file; leave out 'file' and 'columns'")
        return self

    def channel(self) -> ChannelSpec:
        """The columns in the file."""
        if self.file is None:
            raise ValueError("'file' is missing; name a key of [log.files], or say source = 'reference'")
        return ChannelSpec(**self.model_dump(exclude={"source"}))


class LogImuSpec(_Grown):
    """The columns of the IMU.

    Attributes
    ----------
    file : str
        A key of ``[log.files]``.
    samples : {"means", "increments", "instantaneous"}
        What a row holds: the mean over the interval that ends at its time; the increment over that interval (angle
        [rad], velocity [m/s]); or the value at its time. The latter two are converted to means on import:
        increments are divided by their interval, instantaneous values averaged with the row before (trapezoid).
    angular_rate, specific_force : tuple
        Columns in the order forward, starboard, down; ``-`` before a name flips its sign.
    angular_rate_unit, specific_force_unit : str
        Keys of `LOG_UNITS`; of increments the unit of the increment.
    max_gap : float or None
        Longest hole between two rows that is bridged with the value of the row after it [s]. None: ten times the usual
        spacing, at least 1 s; holes above 0.1 s and twice the usual spacing are counted in a warning.
    mounting : (float, float, float)
        Roll, pitch, yaw of the IMU in the vessel [rad]: its readings are turned to the axes of the vessel.
    specific_force_file : str or None
        A key of ``[log.files]``: the file of the specific force, where it is another one, with a clock of its own. Its
        integral is interpolated to the times of the angular rate.
    where : str
        As in `ChannelSpec`.
    """

    later: ClassVar[Mapping[str, Any]] = {"mounting": _LEVEL, "specific_force_file": None, "where": ""}

    file: str
    samples: Literal["means", "increments", "instantaneous"] = "means"
    angular_rate: tuple[Column, Column, Column]
    specific_force: tuple[Column, Column, Column]
    angular_rate_unit: str = "rad_s"
    specific_force_unit: str = "m_s2"
    max_gap: Positive | None = quantity("s", None)
    mounting: Vector = quantity("deg", _LEVEL)
    specific_force_file: str | None = None
    where: str = ""

    @model_serializer(mode="wrap")
    def _without_later(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        table = without_later(handler(self), self.later)
        if table.get("max_gap", 0.0) is None:
            # The default was 0.1 s, and a log with a longer gap did not run: the digest of the others stays.
            table["max_gap"] = 0.1
        return table

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.where:
            RowFilter(self.where)
        check_units((self.angular_rate_unit, self.specific_force_unit))
        increments = self.samples == "increments"  # "rad_s" and "m_s2" are the defaults, and in SI like "rad" and "m_s"
        check_dimension("angular_rate_unit", self.angular_rate_unit, "angular rate", *["angle"] * increments)
        check_dimension("specific_force_unit", self.specific_force_unit, "acceleration", *["speed"] * increments)
        return self


class OriginSpec(Spec):
    """Origin of local Cartesian positions."""

    latitude: Annotated[float, Field(ge=-1.5708, le=1.5708)] = quantity("deg")
    longitude: float = quantity("deg")
    height: float = quantity("m", 0.0)


class ReferenceSpec(_Grown):
    """The reference trajectory that estimates are scored against, for want of the truth.

    Attributes
    ----------
    position : ChannelSpec
        Positions, geodetic or local Cartesian.
    velocity, attitude : ChannelSpec or None
        North-east-down; roll, pitch, yaw. Where absent they are not scored, and the start is made from the positions
        (velocity, heading along the course) and from the accelerometers (roll, pitch).
    lever_arm : (float, float, float)
        From the IMU (or the vessel's reference point) to the point that the reference describes, body axes [m];
        position and velocity are brought back to the IMU with it.
    max_gap : float or None
        The reference is interpolated across holes up to this long [s]; default one and a half times its usual spacing.
    quality : int, str or None
        Column of the file of the position that says how good each fix is.
    fixed, floating : tuple of float
        Its values for fixed and for float solutions; epochs between rows with other values are not scored. By default
        those of RTKLIB.
    fixed_sigma, floating_sigma : (float, float, float) or None
        Standard deviation of such a position, north-east-down [m], where the position has no ``sigma`` of its own.
    """

    later: ClassVar[Mapping[str, Any]] = {
        "quality": None,
        "fixed": (1.0,),
        "floating": (2.0,),
        "fixed_sigma": None,
        "floating_sigma": None,
    }

    position: ChannelSpec
    velocity: ChannelSpec | None = None
    attitude: ChannelSpec | None = None
    lever_arm: Vector = quantity("m", (0.0, 0.0, 0.0))
    max_gap: Positive | None = quantity("s", None)
    quality: Column | None = None
    fixed: tuple[float, ...] = (1.0,)
    floating: tuple[float, ...] = (2.0,)
    fixed_sigma: Vector | None = quantity("m", None)
    floating_sigma: Vector | None = quantity("m", None)

    @model_validator(mode="after")
    def _check_quality(self) -> Self:
        if self.quality is None and (self.fixed_sigma is not None or self.floating_sigma is not None):
            raise ValueError("fixed_sigma_m and floating_sigma_m need 'quality', the column that tells such fixes")
        both = set(self.fixed) & set(self.floating)
        if both:
            raise ValueError(f"fixed and floating have {sorted(both)} in common")
        return self


class RecordedSpec(_Grown):
    """The ``[log]`` table of a recorded scenario.

    Attributes
    ----------
    folder : str
        Below the data root, which is the environment variable ``SIMNAV_DATA``, or ``data`` in the working directory.
        ``gtsam:`` takes the example data that comes with gtsam.
    recordings : str or tuple of str
        Names that take the place of ``{recording}`` in the paths, or a pattern (``"*"``) to find them with. Seed s
        takes recording s modulo their number, in sorted order where they were found by a pattern.
    files : dict of FileSpec
        How each file of a recording is read, by a name that channels use.
    imu : LogImuSpec or None
        The channel of the IMU; None for a log without one.
    instruments : dict of LogInstrumentSpec
        By the names of the scenario's instruments.
    reference : ReferenceSpec
        The trajectory that estimates are scored against.
    origin : OriginSpec or None
        Origin of local Cartesian positions.
    skip : float or tuple of float
        Seconds to leave out at the beginning; one for each recording, or one for all.
    begin : {"first", "moving"}
        The run begins at the first epoch of the reference, or at the first one at which the vessel moves by at least
        1 m/s: then its course gives the heading of a reference without attitude.
    rows_by_seed : bool
        The seed draws with which row ``every`` and ``hold_out`` begin, so that each run of a recording gets other fixes
        and is scored against others.
    """

    later: ClassVar[Mapping[str, Any]] = {"begin": "first", "rows_by_seed": False}

    folder: str = ""
    recordings: str | tuple[str, ...] = "*"
    files: dict[str, FileSpec]
    imu: LogImuSpec | None = None
    instruments: dict[str, LogInstrumentSpec] = Field(default_factory=dict)
    reference: ReferenceSpec
    origin: OriginSpec | None = None
    skip: NonNegative | tuple[NonNegative, ...] = quantity("s", 0.0)
    begin: Literal["first", "moving"] = "first"
    rows_by_seed: bool = False

    @model_validator(mode="before")
    @classmethod
    def _needs_a_reference(cls, table: Any) -> Any:
        if isinstance(table, Mapping) and "reference" not in table:
            raise ValueError(
                "[log.reference.position] is missing; a log without a reference has a part of its fixes there: their "
                "file, columns and units, and hold_out = 10, as 'simnav log inspect' writes them"
            )
        return table

    @model_validator(mode="after")
    def _check(self) -> Self:
        reference = self.reference
        channels: list[tuple[str, ChannelSpec | LogImuSpec]] = [
            (f"instruments.{n}", i.channel()) for n, i in self.instruments.items() if i.source == "file"
        ]
        channels += [
            (f"reference.{n}", c)
            for n, c in (
                ("position", reference.position),
                ("velocity", reference.velocity),
                ("attitude", reference.attitude),
            )
            if c is not None
        ]
        if self.imu is not None:
            channels.append(("imu", self.imu))
            other = self.imu.specific_force_file
            if other is not None and other not in self.files:
                raise ValueError(f"imu.specific_force_file = {other!r} is not in [log.files]{_near(other, self)}")
        for key, file in self.files.items():
            if READERS.get(file.format) is None:
                near = closest(file.format, list(READERS.items()))
                raise ValueError(f"files.{key}.format = {file.format!r} is unknown{near}")
        for name, channel in channels:
            if channel.file not in self.files:
                raise ValueError(f"{name}.file = {channel.file!r} is not in [log.files]{_near(channel.file, self)}")
            reader = READERS.get(self.files[channel.file].format)
            assert reader is not None
            if isinstance(channel, LogImuSpec):
                if not reader.inertial:
                    raise ValueError(f"{name}.file = {channel.file!r} is {reader.title}; an IMU needs a table (csv)")
                continue
            if reader.sentences and channel.sentence is None:
                raise ValueError(f"{name}: the file {channel.file!r} is {reader.title}; say which 'sentence'")
            if not reader.sentences and not channel.columns:
                raise ValueError(f"{name}: 'columns' is missing")
            if channel.frame != "geodetic" and self.origin is None and name == "reference.position":
                raise ValueError(f"{name}.frame = {channel.frame!r} needs [log.origin]")
        if any(reference.lever_arm) and reference.attitude is None:
            raise ValueError("reference.lever_arm_m needs [log.reference.attitude]")
        if not isinstance(self.recordings, str) and not self.recordings:
            raise ValueError("recordings = [] is empty; name at least one, or leave it out")
        return self

    @property
    def stated(self) -> tuple[str, ...]:
        """The instruments whose readings state their standard deviations."""
        return tuple(n for n, i in self.instruments.items() if i.sigma)

    def with_rows(self, number: int) -> Self:
        """The same log, whose channels begin at another row if ``rows_by_seed``.

        Parameters
        ----------
        number : int
            A drawn number; a channel begins at row ``number`` modulo its ``every`` or ``hold_out``.
        """
        if not self.rows_by_seed:
            return self

        def moved(channel: Any) -> Any:
            period = channel.hold_out or channel.every
            return channel.model_copy(update={"first": (channel.first + number) % period})

        reference = {
            n: moved(c) for n in ("position", "velocity", "attitude") if (c := getattr(self.reference, n)) is not None
        }
        return self.model_copy(
            update={
                "instruments": {n: moved(i) for n, i in self.instruments.items()},
                "reference": self.reference.model_copy(update=reference),
            }
        )


def _near(name: str, spec: RecordedSpec) -> str:
    return closest(name, list(spec.files))
