"""Inertial measurement unit: three gyroscopes and three accelerometers with their errors.

The model of a triad (Groves 2013, section 4.4), on means over the sample interval dt::

    y = (I + S + M) x + b + g + r + w / sqrt(dt)

y is the output, x the true angular rate or specific force, S the scale-factor errors, M the non-orthogonality (six
small angles), b the turn-on bias, g the in-run bias (first-order Gauss-Markov), r the rate random walk, and w white
noise (angle or velocity random walk). Then the output saturates at the range, and its increment y dt is quantized; the
quantization residual is added to the next increment.

What depends on specific force, vibration and temperature, the bandwidth and the delay come before this model, and only
where they are named (`simnav.sensors.imu_effects`).

Each process has its own random stream; a process with sigma zero draws nothing. g and r change on a grid of at most
T/100 (or 1 s), with the correlation time T, and are constant between the grid points (`HeldGaussMarkov`), because they
change much more slowly than the sample rate.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, sqrt
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from simnav import kernel_types
from simnav.compiled import kernel, ready
from simnav.kernel_types import Matrix
from simnav.normal_variates import NormalVariates
from simnav.sensors.imu_effects import Effects, ImuEffects
from simnav.sensors.imu_models import GRADES, Grade, ImuModel, imu_model
from simnav.sensors.instrument import figures_of, times_datasheet
from simnav.sensors.processes import HeldGaussMarkov, quantize_scalar
from simnav.spec import NonNegative, Positive, Spec, SpecError, Vector, closest, quantity
from simnav.streams import stream
from simnav.types import Array, ImuDatasheet, ImuSamples, TriadDatasheet

__all__ = [
    "AccelerometerSpec",
    "GyroscopeSpec",
    "HeldTable",
    "Imu",
    "ImuSpec",
    "TriadErrors",
    "TriadSpec",
    "triad_errors",
]

_ZERO: Vector = (0.0, 0.0, 0.0)
#: The error fields of a triad; each name also exists with the prefix ``fixed_``.
_ERRORS = ("bias", "bias_instability", "random_walk", "rate_random_walk", "scale", "misalignment", "quantization")
# Number of samples in a chunk: so the noise is used while it is in the processor's cache.
_CHUNK = 4096


class TriadSpec(Spec):
    """The common fields of gyroscopes and accelerometers; all figures are one sigma, equal on the three axes.

    ``fixed_bias`` and ``fixed_scale`` are constant errors, by axis, which are added to the drawn ones. Estimators do
    not receive them.
    """

    #: The figures that may differ from the datasheet (``times_datasheet``).
    errors: ClassVar[tuple[str, ...]] = _ERRORS

    bias: float
    bias_instability: float
    correlation_time: Positive = quantity("s", inf)
    random_walk: float
    rate_random_walk: float
    scale: NonNegative = quantity("ppm", 0.0, also=("percent",))
    misalignment: NonNegative = quantity("deg", 0.0, also=("mrad",))
    quantization: float
    range: float
    fixed_bias: Vector
    fixed_scale: Vector = quantity("ppm", _ZERO)
    times_datasheet: dict[str, Positive] = Field(
        {}, description="figures that really are so many times what the datasheet says, like `random_walk = 2.5`"
    )
    assumed: tuple[str, ...] = Field((), description="names of the figures that no datasheet states")

    @model_validator(mode="after")
    def _known_figures(self) -> Self:
        valid = figures_of(type(self), self.errors)
        for key, names in (("times_datasheet.", self.times_datasheet), ("assumed: ", self.assumed)):
            for name in names:
                if name not in valid:
                    raise ValueError(f"{key}{name}: there is no such figure{closest(name, valid)}")
        return self

    @model_serializer(mode="wrap")
    def _with_assumptions(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The digest of a scenario without assumed figures is what it was before there were any."""
        table: dict[str, Any] = handler(self)
        if not self.assumed:
            table.pop("assumed", None)
        return table

    @model_validator(mode="after")
    def _correlated(self) -> Self:
        if self.bias_instability > 0.0 and "correlation_time" not in self.model_fields_set:
            raise ValueError("bias_instability needs a correlation_time_s (inf for a random walk)")
        return self

    def datasheet(self) -> TriadDatasheet:
        """The datasheet that an estimator receives."""
        return TriadDatasheet(
            self.bias,
            self.bias_instability,
            self.correlation_time,
            self.random_walk,
            self.rate_random_walk,
            self.scale,
            self.misalignment,
            self.quantization,
            self.range,
            self.assumed,
        )

    def ideal(self) -> Self:
        """The same triad without errors."""
        changes: dict[str, object] = {"range": inf, "assumed": ()}
        for name in type(self).model_fields:
            if name.removeprefix("fixed_") in _ERRORS:
                value = getattr(self, name)
                changes[name] = (0.0,) * len(value) if isinstance(value, tuple) else 0.0
        return self.model_copy(update=changes)


class GyroscopeSpec(TriadSpec):
    """Three gyroscopes; rad/s in memory. With infinite correlation time, bias_instability is in deg/h per sqrt(s)."""

    bias: NonNegative = quantity("deg_h", 0.0, also=("deg_s",))
    bias_instability: NonNegative = quantity("deg_h", 0.0, also=("deg_s",))
    random_walk: NonNegative = quantity("deg_sqrt_h", 0.0, also=("deg_s_sqrt_hz",))
    rate_random_walk: NonNegative = quantity("deg_h_sqrt_h", 0.0)
    quantization: NonNegative = quantity("arcsec", 0.0)
    range: Positive = quantity("deg_s", inf)
    fixed_bias: Vector = quantity("deg_h", _ZERO)


class AccelerometerSpec(TriadSpec):
    """Three accelerometers; m/s^2 in memory. With infinite correlation time, bias_instability is in ug per sqrt(s)."""

    bias: NonNegative = quantity("ug", 0.0, also=("mg", "m_s2", "mm_s2"))
    bias_instability: NonNegative = quantity("ug", 0.0, also=("mg", "m_s2", "mm_s2"))
    random_walk: NonNegative = quantity(
        "ug_sqrt_hz", 0.0, also=("mg_sqrt_hz", "m_s_sqrt_h", "mm_s_sqrt_h", "ft_s_sqrt_h")
    )
    rate_random_walk: NonNegative = quantity("ug_sqrt_s", 0.0)
    quantization: NonNegative = quantity("m_s", 0.0)
    range: Positive = quantity("g", inf, also=("m_s2",))
    fixed_bias: Vector = quantity("ug", _ZERO)


class ImuSpec(Spec):
    """An inertial measurement unit.

    With ``model`` or ``grade`` its figures are those of a manufacturer (`simnav.sensors.imu_models`). Where the
    datasheet is silent, figures of the grade are assumed. Figures that are given beside it replace them one by one.

    Attributes
    ----------
    rate : float
        Samples per second [Hz].
    gyroscope, accelerometer : GyroscopeSpec, AccelerometerSpec
        Figures of the three axes.

    Examples
    --------
    >>> imu = ImuSpec.from_toml({"rate_hz": 100, "gyroscope": {"random_walk_deg_sqrt_h": 0.01}})
    >>> round(imu.gyroscope.random_walk * 1e6, 3)
    2.909
    >>> imu = ImuSpec.from_toml({"rate_hz": 100, "model": "STIM300", "accelerometer": {"bias_mg": 0.5}})
    >>> round(imu.gyroscope.random_walk * 1e6, 3), round(imu.accelerometer.bias, 6)
    (43.633, 0.004903)
    """

    kind: Literal["imu"] = "imu"
    rate: Positive = quantity("hz")
    model: str | None = Field(None, description="an IMU by its name")
    grade: Grade | None = Field(None, description="the IMU that stands for a grade")
    gyroscope: GyroscopeSpec = GyroscopeSpec()
    accelerometer: AccelerometerSpec = AccelerometerSpec()
    effects: ImuEffects | None = Field(None, description="errors by specific force, vibration and temperature")

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], *, source: str = "<toml>", path: str = "") -> Self:
        """See `Spec.from_toml`. The figures of ``model`` or ``grade`` are added to the table."""
        if isinstance(table, Mapping) and ("model" in table or "grade" in table):
            try:
                figures = _named(table.get("model"), table.get("grade")).to_toml()
            except SpecError as error:
                raise SpecError(f"{source}: {path or 'the file'}: {error}") from None
            parts: tuple[tuple[str, type[Spec]], ...] = (
                ("gyroscope", GyroscopeSpec), ("accelerometer", AccelerometerSpec), ("effects", ImuEffects),
            )  # fmt: skip
            for name, spec in parts:
                given = table.get(name, {})
                if name in figures and isinstance(given, Mapping):
                    said = spec.fields_of(given)
                    whole = spec.replaced(figures[name], given)
                    if "assumed" in whole and "assumed" not in given:
                        whole["assumed"] = [figure for figure in whole["assumed"] if figure not in said]
                    table = {**table, name: whole}
        return super().from_toml(table, source=source, path=path)

    @model_validator(mode="before")
    @classmethod
    def _with_figures(cls, data: Any) -> Any:
        """In Python: the figures of ``model`` or ``grade``, where no others are given."""
        if not isinstance(data, dict) or (data.get("model") is None and data.get("grade") is None):
            return data
        figures = _named(data.get("model"), data.get("grade")).to_toml()
        made: dict[str, Spec] = {
            "gyroscope": GyroscopeSpec.from_toml(figures["gyroscope"]),
            "accelerometer": AccelerometerSpec.from_toml(figures["accelerometer"]),
        }
        if "effects" in figures:
            made["effects"] = ImuEffects.from_toml(figures["effects"])
        return {**made, **data}

    @model_serializer(mode="wrap")
    def _without_names(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The name of an IMU decides nothing beside its figures. Digests of scenarios count what is there."""
        table: dict[str, Any] = handler(self)
        for name in ("model", "grade") if self.effects is not None else ("model", "grade", "effects"):
            table.pop(name, None)
        return table

    def datasheet(self) -> ImuDatasheet:
        """The datasheet that an estimator receives."""
        return ImuDatasheet(self.rate, self.gyroscope.datasheet(), self.accelerometer.datasheet())

    def actual(self) -> ImuSpec:
        """The instrument with its true figures: those of the datasheet times ``times_datasheet``."""
        triads = {"gyroscope": times_datasheet(self.gyroscope), "accelerometer": times_datasheet(self.accelerometer)}
        if triads["gyroscope"] is self.gyroscope and triads["accelerometer"] is self.accelerometer:
            return self
        return self.model_copy(update=triads)

    def ideal(self) -> ImuSpec:
        """The same instrument without errors."""
        triads = {"gyroscope": self.gyroscope.ideal(), "accelerometer": self.accelerometer.ideal()}
        return self.model_copy(update={**triads, "effects": None})

    def build(self, seed: int) -> Imu:
        """Make the instrument of one run.

        Parameters
        ----------
        seed : int
            Seed of the run.
        """
        return Imu(self, seed)


def _named(model: Any, grade: Any) -> ImuModel:
    """The IMU of a model or of a grade. SpecError if there is none, or both are given."""
    if model is not None and grade is not None:
        raise SpecError("give a model or a grade, not both")
    key, name = ("grade", grade) if model is None else ("model", model)
    if not isinstance(name, str):
        raise SpecError(f"{key} = {name!r} should be a name in quotes")
    if key == "grade" and name not in GRADES:
        raise SpecError(f"grade = {name!r} is unknown{closest(name, list(GRADES))}")
    if key == "model" and name in GRADES:
        raise SpecError(f"model = {name!r} is a grade; say grade = {name!r}")
    return imu_model(name)


class HeldTable(NamedTuple):
    """A bias that is constant between the rows of a table.

    Attributes
    ----------
    rows : (k, 3) array
        The bias [rad/s or m/s^2].
    first : int
        Number of the first row.
    per_second : float
        Number of rows in a second.
    """

    rows: Matrix
    first: int
    per_second: float


class TriadErrors(NamedTuple):
    """The error parameters of a triad.

    Attributes
    ----------
    matrix : (3, 3) array
        I + S + M, with scale factor and misalignment.
    bias : (3,) array
        Turn-on bias [rad/s or m/s^2].
    density : float
        Density of the white noise.
    range : float
        Largest absolute value of a sample.
    step : float
        Quantization step of the increment; 0: none.
    """

    matrix: Matrix
    bias: kernel_types.Vector
    density: float
    range: float
    step: float


@kernel
def triad_errors(
    ideal: Matrix,
    variates: Matrix,
    out: Matrix,
    time: kernel_types.Vector,
    interval: kernel_types.Vector,
    triad: TriadErrors,
    in_run: HeldTable,
    walk: HeldTable,
    residual: kernel_types.Vector,
) -> None:
    """Add the errors of one triad (see the module).

    Parameters
    ----------
    ideal, variates : (n, 3) arrays
        Samples of an ideal triad [rad/s or m/s^2]; unit variates of the white noise.
    out : (n, 3) array
        Samples with errors, overwritten; it may be the same array as ``ideal``.
    time, interval : (n,) arrays
        Ends of the sample intervals, and their lengths [s].
    triad : TriadErrors
        Error parameters of the triad.
    in_run, walk : HeldTable
        In-run bias g and rate random walk r.
    residual : (3,) array
        Quantization residual of the increments so far; updated.
    """
    matrix, bias, density, limit, step = triad.matrix, triad.bias, triad.density, triad.range, triad.step
    last_i = len(in_run.rows) - 1
    last_w = len(walk.rows) - 1
    for i in range(len(time)):
        dt = interval[i]
        noise = density / sqrt(dt)
        ki = min(max(int(time[i] * in_run.per_second + 1e-6) - in_run.first, 0), last_i)
        kw = min(max(int(time[i] * walk.per_second + 1e-6) - walk.first, 0), last_w)
        x, y, z = ideal[i, 0], ideal[i, 1], ideal[i, 2]
        for j in range(3):
            value = matrix[j, 0] * x + matrix[j, 1] * y + matrix[j, 2] * z
            value += bias[j] + in_run.rows[ki, j] + walk.rows[kw, j] + noise * variates[i, j]
            value = min(max(value, -limit), limit)
            if step > 0.0:
                increment, residual[j] = quantize_scalar(value * dt, step, residual[j])
                value = increment / dt
            out[i, j] = value


class _Still:
    """A bias process that is always zero."""

    per_second = 0.0
    _table = np.zeros((1, 3))

    def table(self, until: float) -> tuple[Array, int]:
        return self._table, 0


class _Triad:
    """The realised errors of one triad."""

    def __init__(self, spec: TriadSpec, name: str, rate: float, seed: int):
        def drawn(process: str, sigma: float, n: int) -> Array:
            if sigma <= 0.0:
                return np.zeros(n)
            return sigma * stream(seed, "instrument", "imu", name, process).standard_normal(n)

        def held(process: str, sigma: float, correlation_time: float) -> HeldGaussMarkov | _Still:
            if sigma <= 0.0:
                return _Still()
            hold = min(1.0, max(correlation_time / 100.0, 1.0 / rate))
            rng = stream(seed, "instrument", "imu", name, process)
            return HeldGaussMarkov(np.full(3, sigma), correlation_time, hold, rng)

        self.matrix = np.eye(3) + np.diag(drawn("scale", spec.scale, 3) + spec.fixed_scale)
        self.matrix[~np.eye(3, dtype=bool)] = drawn("misalignment", spec.misalignment, 6)
        self.bias = drawn("bias", spec.bias, 3) + spec.fixed_bias
        self.instability = held("bias_instability", spec.bias_instability, spec.correlation_time)
        self.walk = held("rate_random_walk", spec.rate_random_walk, inf)
        self.density = spec.random_walk
        self.range, self.step = spec.range, spec.quantization
        self.residual = np.zeros(3)
        self._noise = NormalVariates(stream(seed, "instrument", "imu", name, "random_walk"))
        self._variates = np.zeros((_CHUNK, 3))

    def ahead(self, variates: Array, until: float) -> tuple[HeldTable, HeldTable]:
        """Fill the (n, 3) variates of `sense`; return the tables of the in-run bias and of the random walk."""
        if self.density > 0.0:
            self._noise.fill(variates)
        return self._tables(until)

    def _tables(self, until: float) -> tuple[HeldTable, HeldTable]:
        return (
            HeldTable(*self.instability.table(until), self.instability.per_second),
            HeldTable(*self.walk.table(until), self.walk.per_second),
        )

    def sense(self, ideal: Array, time: Array, interval: Array, out: Array) -> None:
        until = float(time[-1])
        triad = TriadErrors(self.matrix, self.bias, self.density, self.range, self.step)
        in_run, walk = self._tables(until)
        for a in range(0, len(time), _CHUNK):
            part = slice(a, a + _CHUNK)
            if self.density > 0.0:
                self._noise.fill(self._variates[: len(time[part])])
            triad_errors.unchecked(
                ideal[part], self._variates, out[part], time[part], interval[part], triad, in_run, walk, self.residual
            )  # fmt: skip


class Imu:
    """An IMU in one run. Its errors are drawn at the start and continue from block to block.

    Parameters
    ----------
    spec : ImuSpec
        Rate and error parameters, from the scenario.
    seed : int
        Seed of the run.
    """

    def __init__(self, spec: ImuSpec, seed: int):
        self.spec = spec
        self.gyroscope = _Triad(spec.gyroscope, "gyroscope", spec.rate, seed)
        self.accelerometer = _Triad(spec.accelerometer, "accelerometer", spec.rate, seed)
        named = spec.effects is not None and bool(spec.effects.names)
        self.effects = Effects(spec.effects, spec.rate, seed) if named and spec.effects is not None else None

    def sense(self, ideal: ImuSamples, *, overwrite: bool = False) -> ImuSamples:
        """Add the errors to the ideal samples of the next block.

        Parameters
        ----------
        ideal : ImuSamples
            Ideal samples: means over each interval.
        overwrite : bool
            True: store the result in the arrays of ``ideal``, if they are writable. On a long run the allocation of new
            memory takes as long as the computation of the errors.

        Returns
        -------
        ImuSamples
            Samples with errors at the same times.
        """
        if len(ideal) == 0:
            return ideal
        if self.effects is not None:
            ideal = self.effects.apply(ideal)
        time, interval = ready(ideal.time), ready(ideal.interval)
        both = ready(ideal.angular_rate), ready(ideal.specific_force)
        # One piece of memory: in a long run the system gives it in large pages.
        rate, force = both if overwrite else np.empty((2, len(time), 3))
        self.gyroscope.sense(both[0], time, interval, rate)
        self.accelerometer.sense(both[1], time, interval, force)
        return ImuSamples(ideal.time, ideal.interval, rate, force)
