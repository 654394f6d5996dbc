"""An estimator that is a program of its own: it reads lines of text and answers each step with a line.

The lines are in ``docs/how-to/connect-a-program.md``. The program gets one step at a time and must answer it before it
gets the next one, so it is as causal as any estimator; it is a child of the estimator's process, and confined with it.
"""

from __future__ import annotations

import contextlib
import inspect
import json
import math
import os
import selectors
import shlex
import subprocess
import tempfile
import time
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any, ClassVar

import numpy as np

from simnav.estimator.contract import Estimator, EstimatorError
from simnav.types import Estimate, InitialState, Instruments, Measurements

__all__ = ["PROTOCOL", "ProgramEstimator"]

#: Version of the lines.
PROTOCOL = 1
#: A line of a program has at most so many bytes.
_LONGEST = 1 << 20
#: How much of what a program wrote to its error stream is shown.
_SHOWN = 300
_VECTORS = ("position", "velocity", "attitude")


class ProgramEstimator(Estimator):
    """Runs a program, sends it the start and the packets, and reads its estimates.

    Register a subclass in a file of your own; see ``docs/how-to/connect-a-program.md``.

    Parameters
    ----------
    program : str
        The program with its arguments, as in a shell. The program is looked for beside the file of the class first,
        and runs in that folder, so arguments may name files there. Default: the class attribute ``program``.
    lines : {"csv", "json"}
        Form of the lines.
    patience : float
        How long an answer may take [s].

    Raises
    ------
    EstimatorError
        If no program is named, or the form is unknown.
    """

    program: ClassVar[str] = ""
    lines: ClassVar[str] = "csv"

    def __init__(self, program: str = "", lines: str = "", patience: float = 60.0):
        self._command = shlex.split(program or type(self).program)
        self._form = lines or type(self).lines
        self._patience = patience
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None
        self._received = b""
        if not self._command:
            raise EstimatorError(f"{type(self).__name__}: program = '' names no program; give one, like './my_filter'")
        if self._form not in ("csv", "json"):
            raise EstimatorError(f"{type(self).__name__}: lines = {self._form!r} should be 'csv' or 'json'")

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """See `Estimator.reset`: the program is started anew."""
        self._end()
        command = [self._found(self._command[0]), *self._command[1:]]
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (lives as long as the program)
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, bufsize=0,
                cwd=self._folder(),
            )  # fmt: skip
        except OSError as error:
            raise EstimatorError(f"the program {command[0]!r} cannot be started: {error.strerror}") from None
        weakref.finalize(self, _kill, self._process)
        self._received = b""
        self._send(self._json_start(start, instruments) if self._form == "json" else _csv_start(start, instruments))
        answer = self._line("its 'ready'")
        if answer != "ready":
            raise EstimatorError(f"the program answered {answer[:100]!r} to the start, where 'ready' is wanted")

    def update(self, measurements: Measurements) -> Estimate:
        """See `Estimator.update`."""
        if self._process is None:
            raise EstimatorError("update() before reset()")
        self._send(_json_step(measurements) if self._form == "json" else _csv_step(measurements))
        answer = self._line(f"the estimate at {measurements.time:g} s")
        return _json_estimate(answer) if self._form == "json" else _csv_estimate(answer)

    def _folder(self) -> Path | None:
        """The folder of the file of a subclass; a class of a notebook has none."""
        if type(self) is ProgramEstimator:
            return None
        try:
            folder = Path(inspect.getfile(type(self))).resolve().parent
        except (TypeError, OSError):
            return None
        return folder if folder.is_dir() else None

    def _found(self, name: str) -> str:
        folder = self._folder()
        if folder is not None and (folder / name).is_file():
            return str(folder / name)
        return str(Path(name).resolve()) if "/" in name and Path(name).is_file() else name

    def _end(self) -> None:
        if self._process is not None:
            _kill(self._process)
        self._process = None

    def _send(self, lines: Sequence[str]) -> None:
        process = self._process
        assert process is not None
        assert process.stdin is not None
        rest = memoryview(("\n".join(lines) + "\n").encode())
        try:
            while rest:
                rest = rest[process.stdin.write(rest) or 0 :]
        except (BrokenPipeError, ValueError):
            raise EstimatorError(f"the program has ended {self._said()}") from None

    def _line(self, what: str) -> str:
        """The next line of the program."""
        process = self._process
        assert process is not None
        assert process.stdout is not None
        deadline = time.monotonic() + self._patience
        with selectors.DefaultSelector() as ready:
            ready.register(process.stdout, selectors.EVENT_READ)
            while b"\n" not in self._received:
                if len(self._received) > _LONGEST:
                    raise EstimatorError(f"the program wrote more than {_LONGEST} bytes in one line")
                if not ready.select(max(0.0, deadline - time.monotonic())):
                    raise EstimatorError(f"the program did not write {what} within {self._patience:g} s {self._said()}")
                part = os.read(process.stdout.fileno(), 1 << 16)
                if not part:
                    process.wait(1.0)
                    raise EstimatorError(f"the program ended before it wrote {what} {self._said()}")
                self._received += part
        line, _, self._received = self._received.partition(b"\n")
        return line.decode(errors="replace").strip()

    def _said(self) -> str:
        """The exit code and the end of the error stream."""
        assert self._process is not None
        assert self._errors is not None
        code = self._process.poll()
        size = os.fstat(self._errors.fileno()).st_size
        self._errors.seek(max(0, size - _SHOWN))
        text = " ".join(self._errors.read().decode(errors="replace").split())
        ended = "(it is still running)" if code is None else f"(exit code {code})"
        return f"{ended}: {text}" if text else ended

    def _json_start(self, start: InitialState, instruments: Instruments) -> list[str]:
        imu = instruments.imu
        content: dict[str, Any] = {
            "type": "start",
            "protocol": PROTOCOL,
            "step": instruments.step,
            "time": start.time,
            **{name: getattr(start, name).tolist() for name in _VECTORS},
            "covariance": start.covariance.tolist(),
            "imu": None if imu is None else {"rate": imu.rate, **{t: vars(getattr(imu, t)) for t in _TRIADS}},
            "instruments": [
                {"name": s.name, "kind": s.kind, "rate": s.rate, "sigma": s.sigma.tolist(),
                 "bias": s.bias.tolist(), "lever_arm": s.lever_arm.tolist(), "channels": list(s.channels),
                 **({} if s.timing is None else {"timing": vars(s.timing)})}
                for s in instruments.values()
            ],
        }  # fmt: skip
        return [json.dumps(_finite(content))]


_TRIADS = ("gyroscope", "accelerometer")


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End a program; it gets a moment to end by itself when its input is closed."""
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()
    try:
        process.wait(0.2)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _finite(value: Any) -> Any:
    """The same with null in place of infinity, which JSON does not have."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _csv(*cells: Any) -> str:
    return ",".join(c if isinstance(c, str) else repr(float(c)) for c in cells)


def _csv_start(start: InitialState, instruments: Instruments) -> list[str]:
    lines = [
        f"protocol,{PROTOCOL}",
        _csv("start", start.time, instruments.step, *start.position, *start.velocity, *start.attitude),
        _csv("covariance", *start.covariance.ravel()),
    ]
    if instruments.imu is not None:
        lines.append(_csv("imu_rate", instruments.imu.rate))
        for name in _TRIADS:
            t = getattr(instruments.imu, name)
            lines.append(_csv(name, t.bias, t.bias_instability, t.correlation_time, t.random_walk))
    for s in instruments.values():
        lines.append(_csv("instrument", s.name, s.kind, s.rate, *s.lever_arm, *s.sigma))
    return [*lines, "begin"]


def _csv_step(measurements: Measurements) -> list[str]:
    lines = []
    imu = measurements.imu
    if imu is not None:
        rows = np.column_stack([imu.time, imu.interval, imu.angular_rate, imu.specific_force])
        lines += [_csv("imu", *row) for row in rows]
    lines += [_csv("measurement", m.source, m.kind, m.time, *m.value, *m.side) for m in measurements]
    return [*lines, _csv("step", measurements.time)]


def _csv_estimate(line: str) -> Estimate:
    """``estimate,TIME,LATITUDE,...,YAW`` and perhaps nine standard deviations; an empty cell is not estimated."""
    word, *cells = line.split(",")
    if word != "estimate" or len(cells) not in (10, 19):
        raise EstimatorError(
            f"the program answered {line[:100]!r}; wanted is 'estimate', the time, nine numbers, and perhaps nine "
            "standard deviations, separated by commas"
        )
    try:
        numbers = np.array([float(c) if c.strip() else math.nan for c in cells])
    except ValueError:
        raise EstimatorError(f"the program answered {line[:100]!r}, in which a cell is not a number") from None
    state = numbers[1:10]
    given = np.array([bool(c.strip()) for c in cells[1:10]])
    vectors: dict[str, Any] = {
        n: state[3 * i : 3 * i + 3] for i, n in enumerate(_VECTORS) if given[3 * i : 3 * i + 3].any()
    }
    covariance = None
    if len(cells) == 19:
        covariance = np.diag(np.where(given, np.nan_to_num(numbers[10:]), 0.0) ** 2)
    return Estimate(float(numbers[0]), **vectors, covariance=covariance, estimated=_of_errors(given))


def _of_errors(estimated: Any) -> Any:
    """Which error components are estimated: roll and pitch together are the attitude about north and east."""
    return np.concatenate([estimated[:6], [estimated[6] and estimated[7]] * 2, estimated[8:]])


def _json_step(measurements: Measurements) -> list[str]:
    imu = measurements.imu
    rows = None
    if imu is not None:
        rows = np.column_stack([imu.time, imu.interval, imu.angular_rate, imu.specific_force]).tolist()
    content = {
        "type": "step",
        "start": measurements.start,
        "time": measurements.time,
        "imu": rows,
        "measurements": [
            {"instrument": m.instrument, "kind": m.kind, "channel": m.channel, "time": m.time,
             "value": m.value.tolist(), "side": m.side.tolist()}
            for m in measurements
        ],
    }  # fmt: skip
    return [json.dumps(_finite(content))]


def _json_estimate(line: str) -> Estimate:
    """An object with ``time`` and what is estimated."""
    try:
        content = json.loads(line)
        if not isinstance(content, dict) or "time" not in content:
            raise ValueError
        vectors: dict[str, Any] = {
            n: np.array(content[n], dtype=np.float64) for n in _VECTORS if content.get(n) is not None
        }
        covariance = content.get("covariance")
        sigma = content.get("sigma")
        if sigma is not None:
            covariance = np.diag(np.array(sigma, dtype=np.float64) ** 2)
        estimated = content.get("estimated")
        return Estimate(
            float(content["time"]),
            **vectors,
            covariance=None if covariance is None else np.array(covariance, dtype=np.float64),
            estimated=None if estimated is None else np.array(estimated, dtype=bool),
            diagnostics={str(k): np.array(v, dtype=np.float64) for k, v in content.get("diagnostics", {}).items()},
            flagged=[(str(name), float(at)) for name, at in content.get("flagged", [])],
        )
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise EstimatorError(
            f"the program answered {line[:100]!r}; wanted is a JSON object with 'time' and what is estimated of "
            "'position', 'velocity', 'attitude', 'covariance' or 'sigma'"
        ) from None
