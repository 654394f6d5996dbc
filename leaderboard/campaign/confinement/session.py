"""The worker's side: a server of its own, and sessions with the estimator processes that it forks."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import pickle
import select
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.campaign.request import file_of
from simnav.trial import TOGETHER, FailureError, LostError
from simnav.trial.wire import ANSWER, ESTIMATE, InvalidOutputError, PacketEncoder
from simnav.types import NavigationStates

from . import bubblewrap, landlock, privileges
from .estimator_process import LIBRARIES
from .kinds import homes_of_kinds
from .limits import why_it_died
from .memory_group import MemoryGroup
from .messages import LARGEST, Down, Up, command
from .reachable_kernels import ALL
from .replies import facts_in, trajectory_in
from .resource_use import PROCESSES

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.entrant import Entrant
    from simnav.recording import Recording
    from simnav.trial.log import TrialLog

__all__ = ["LOST", "EstimatorServer", "Limits", "NoAnswerError", "RemoteSession", "ServerError", "StoppedError"]

#: Reason of an estimator that ended its server.
LOST = "it ended the process that had started it"

#: Environment variables that an estimator process inherits; all others are left out.
_ENVIRONMENT = (
    "PATH", "HOME", "USER", "LANG", "LC_ALL", "LC_CTYPE", "TZ", "PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV",
    "CONDA_PREFIX", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "XDG_CACHE_HOME", "SIMNAV_CACHE_DIR", "TMPDIR",
    "CUDA_VISIBLE_DEVICES",
    # These choose the machine code of linear algebra, and so the last bits of its results.
    "OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE", "MKL_CBWR", "BLIS_ARCH_TYPE", "NPY_DISABLE_CPU_FEATURES",
    "NPY_ENABLE_CPU_FEATURES", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES",
)  # fmt: skip
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMBA_NUM_THREADS")
_START = 900.0  # for a server to be ready; on a slow and busy machine compiling takes minutes [s]
_END = 20.0  # for a server to look after what is left of an estimator process [s]
_PIECE = 1 << 16
_TICK = 1000.0  # the longest wait between two looks at the clock [ms]
_LONGEST_HELD = 50.0  # of a step, or of all since answers were last judged: then they are judged before the next [ms]
_STEPS = 64  # whose answers are judged together at most
_BYTES = 1 << 20  # of answers that are judged together
_STATE = 160  # bytes of a smoothed state, and as much again
_SIZE = struct.Struct("<8xI")  # of an answer: bytes after the header


class ServerError(Exception):
    """The server cannot be started."""


class NoAnswerError(ServerError):
    """The server is gone, or forks nothing: so no estimator has been started, and none is to blame."""


class StoppedError(LostError):
    """The estimator process is no more there.

    Parameters
    ----------
    status : str
        As of `simnav.leaderboard.campaign.confinement.isolation.Outcome`.
    reason : str
        Description of the event, for the user.
    """

    def __init__(self, status: str, reason: str):
        super().__init__(reason)
        self.status, self.reason = status, reason


@dataclass(frozen=True)
class Limits:
    """What an estimator process may take.

    Attributes
    ----------
    timeout : float
        Wall-clock time [s].
    memory : int
        Beyond what it starts with [bytes].
    """

    timeout: float
    memory: int


class EstimatorServer:
    """A prepared process that forks estimator processes (see `server`).

    Parameters
    ----------
    confinement : {"process", "bubblewrap"}
        A process of its own, or that in a sandbox of bubblewrap.
    hidden : sequence of Path
        What estimators must not read: the folder of the results, and the file of a secret key.
    loaded : sequence of str
        Load the kernels of these modules at once (`reachable_kernels`).
    sealed : bool
        Keep nothing that estimators write from one campaign to the next.

    Attributes
    ----------
    confinement : str
        Confinement in force: ``process``, ``landlock`` or ``bubblewrap``.
    hidden : tuple of Path
        Paths that estimators cannot read.
    sealed : bool
        Whether the campaign is sealed. Under ``bubblewrap`` the hidden paths are fixed; otherwise both apply to the
        next run.
    used : bool
        Whether it has started any estimator process.

    Raises
    ------
    ServerError
        If it does not start.
    """

    def __init__(
        self, confinement: str, hidden: Sequence[Path] = (), *, loaded: Sequence[str] = (ALL,), sealed: bool = False
    ):
        self._landlock = landlock.available()
        self.confinement = confinement if confinement != "process" or not self._landlock else "landlock"
        self.hidden, self.sealed, self.used = tuple(hidden), sealed, False
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        environment = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}
        environment |= dict.fromkeys(_THREADS, "1")
        environment["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p)  # as this process finds simnav
        command_line = [sys.executable, "-P", "-m", f"{__package__}.server", str(theirs.fileno())]
        if confinement == "bubblewrap":
            command_line = bubblewrap.wrapped(command_line, environment, self.hidden, writable=self._caches())
        try:
            self._process = subprocess.Popen(
                command_line, env=environment, cwd="/", pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise ServerError(f"{command_line[0]} cannot be started: {error.strerror}") from None
        finally:
            theirs.close()
        self._control = ours
        self._awaited, self._started = 1, False
        self._loaded: set[str] = set()
        self._group = MemoryGroup()
        self.load(loaded)

    @property
    def process_id(self) -> int:
        """Id of the process that was started; in a sandbox that of ``bwrap``."""
        return self._process.pid

    def _caches(self) -> Path | None:
        """Folder of the kernels that estimators of files compile, each in one of its own."""
        from simnav.compiled import cache_directory

        root = cache_directory()
        if root is None or not self._landlock:
            return None
        folder = root.parent / "estimators"
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, exist_ok=True)
            return folder
        return None

    @staticmethod
    def _digest(entrant: Entrant) -> str:
        """What tells an entrant from all others."""
        known = f"{entrant.name} {entrant.label} {sorted(entrant.parameters.items())!r} {entrant.source}"
        return hashlib.blake2b(known.encode(errors="surrogatepass"), digest_size=8).hexdigest()

    def _cache(self, entrant: Entrant) -> str:
        """Folder of the kernels that a file compiles; empty where there is none.

        Each entrant has one of its own: two of one file could otherwise tell each other of a run that only one of them
        has seen to its end. In a sealed campaign the folder goes with the server.
        """
        if not self._landlock:
            return ""
        name = self._digest(entrant)
        caches = None if self.sealed else self._caches()
        return name if caches is None else str(caches / name)

    def fits(self, confinement: str, hidden: Sequence[Path]) -> bool:
        """Whether it serves what is asked for, and is there."""
        same = self.confinement == confinement or (confinement == "process" and self.confinement == "landlock")
        return same and (confinement != "bubblewrap" or tuple(hidden) == self.hidden) and self._process.poll() is None

    def load(self, modules: Iterable[str]) -> None:
        """Ask for the kernels of some modules, once; it begins at once, and `wait_until_ready` waits for the end."""
        missing = sorted(set(modules) - self._loaded)
        if missing and ALL not in self._loaded:
            self._loaded.update(missing)
            with contextlib.suppress(OSError):  # it is gone: whoever waits for it is told
                self._control.sendall(json.dumps({"load": missing}).encode())
            self._awaited += 1

    def wait_until_ready(self) -> None:
        """Wait until it has started, and has loaded what it was asked for.

        Raises
        ------
        ServerError
            If it does not start.
        NoAnswerError
            If it had started, and is gone.
        """
        while self._awaited:
            facts = self._receive(_START)
            if facts is None or not facts.get("ready"):
                self._process.kill()
                if self._started:
                    raise NoAnswerError("the process for estimators did not answer")
                words = (self._process.stderr.read() if self._process.stderr else b"").decode(errors="replace")
                last = words.strip().splitlines()[-1:] or ["it ended, or was silent for 15 minutes"]
                self.close()
                raise ServerError(f"the process for estimators does not start: {last[0][:300]}")
            self._awaited, self._started = self._awaited - 1, True

    def close(self) -> None:
        """End it, and all that it started."""
        self._control.close()  # it ends by itself, and kills what it forked
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stderr is not None:
            self._process.stderr.close()
        self._group.close()

    def _receive(self, seconds: float) -> dict[str, Any] | None:
        with contextlib.suppress(OSError, ValueError):
            if select.select([self._control], [], [], seconds)[0]:
                data = self._control.recv(_PIECE)
                return dict(json.loads(data)) if data else None
        return None

    @contextlib.contextmanager
    def session(self, entrant: Entrant, limits: Limits, core: int | None = None) -> Iterator[RemoteSession]:
        """An estimator process, until the end of the block.

        Parameters
        ----------
        entrant : Entrant
            Which estimator, and its parameters.
        limits : Limits
            What the process may take.
        core : int, optional
            On which it runs.

        Raises
        ------
        NoAnswerError
            If there is no process, since the server did not start one.
        ServerError
            If the process could not be confined.
        StoppedError
            If the process is no more there; also where it ended after its last answer.
        """
        self.wait_until_ready()
        down, write = os.pipe()
        read, up = os.pipe()
        file = file_of(entrant.name)
        asked = {
            "timeout": limits.timeout,
            "memory": limits.memory,
            "landlock": self._landlock,
            "core": core,
            "folder": os.path.dirname(file) or "/",
            "cache": self._cache(entrant) if file else "",
            "user": privileges.user_for(int(self._digest(entrant), 16)),
            "hidden": [str(path) for path in self.hidden],
        }
        passed = [down, up]
        if self._group.limit(limits.memory):
            passed.append(self._group.joining)
        kills, self.used = self._group.kills(), True
        try:
            try:
                socket.send_fds(self._control, [json.dumps({"fork": asked}).encode()], passed)
                facts = self._receive(_END)
            except OSError:
                facts = None
            finally:
                os.close(down)
                os.close(up)
            if facts is None or "forked" not in facts:
                raise NoAnswerError("the process for estimators did not answer")
            if facts.get("fault"):
                raise ServerError(
                    f"the system has {facts['fault']}, but refuses it to estimator processes, so they cannot be "
                    "confined; confinement = 'none' runs estimators that you trust"
                )
            session = RemoteSession(write, read, limits, together=TOGETHER if entrant.ours else 1)
            try:
                yield session
            except _GoneError:
                raise self._finish(session, kills, gone=True) from None
            except BaseException:
                self._finish(session, kills, gone=False)
                raise
            self._finish(session, kills, gone=False)
            if session.libraries and not self.sealed:  # what one has imported, the next would see
                with contextlib.suppress(OSError):
                    self._control.sendall(json.dumps({"import": session.libraries}).encode())
        finally:
            os.close(write)
            os.close(read)

    def _finish(self, session: RemoteSession, kills: int, *, gone: bool) -> StoppedError:
        """Have the process killed with all that it started; how it ended."""
        facts = None
        with contextlib.suppress(OSError):
            self._control.sendall(json.dumps({"finish": True, "gone": gone}).encode())
            facts = self._receive(_END)
        if facts is None:
            self._process.kill()
            return StoppedError("error", LOST)
        session.peak_memory = max(0, int(facts.get("peak", 0)))
        ended, verdict = str(facts.get("ended") or "it closed its pipe"), facts.get("verdict")
        memory = session.limits.memory
        if verdict == "out-of-memory":
            return StoppedError("out-of-memory", f"stopped when it had taken more than {memory >> 20} MiB of memory")
        if verdict == "error":
            return StoppedError("error", f"stopped when it had started more than {PROCESSES} processes")
        by_kernel = verdict == "killed" or (ended == "SIGKILL" and self._group.kills() > kills)
        return StoppedError(*why_it_died(ended, session.peak_memory, memory, by_kernel=by_kernel))


class _GoneError(LostError):
    """The estimator process has closed its pipe."""


class RemoteSession:
    """An estimator in a process of its own; a `simnav.trial.Session`.

    Parameters
    ----------
    write, read : int
        Descriptors of the pipes.
    limits : Limits
        What the process may take.
    together : int
        So many steps are handed over in one packet. Whoever is not trusted gets one, and could look ahead in more.

    Attributes
    ----------
    needs : object
        As it declared them before it knew the instruments.
    observed : object
        The instruments that it says it uses.
    libraries : list of str
        What it imported, and the server may import, too.
    peak_memory : int
        Known when the process is gone [bytes].
    """

    def __init__(self, write: int, read: int, limits: Limits, together: int = 1):
        self.name, self._together = "", together
        self.needs: Any = ()
        self.observed: Any = None
        self.limits = limits
        self.libraries: list[str] = []
        self.peak_memory = 0
        self._silent = False  # it is gone, or has not answered all that it was sent
        self._write, self._read = write, read
        self._deadline = time.monotonic() + limits.timeout
        os.set_blocking(write, False)
        os.set_blocking(read, False)  # it can open its pipe again, and take back what it has written
        self._steps = 0
        self._readable, self._writable = select.poll(), select.poll()
        self._readable.register(read, select.POLLIN)
        self._writable.register(write, select.POLLOUT)

    # -- the steps of a run ------------------------------------------------------------------------

    def make(self, entrant: Entrant, words: list[int]) -> None:
        """Make the estimator, with these words as the seed of global generators.

        Raises
        ------
        simnav.trial.FailureError
            If that fails.
        """
        facts = facts_in(self._ask(Down.MAKE, (entrant, _search_path(), words)))
        name, needs = facts.get("name"), facts.get("needs")
        self.needs = tuple(tuple(n) if isinstance(n, list) else n for n in needs) if isinstance(needs, list) else needs
        self.name = name[:200] if isinstance(name, str) else ""

    def describe_estimator(self, entrant: Entrant) -> dict[str, Any]:
        """What `estimator_process` says of an estimator.

        Raises
        ------
        simnav.trial.FailureError
            If it cannot be found.
        """
        return facts_in(self._ask(Down.DESCRIBE, (entrant, _search_path(), [0])))

    def begin(self, recording: Recording, packets: PacketEncoder) -> None:
        """Hand over start and datasheets."""
        homes = homes_of_kinds(recording.instruments)
        facts = facts_in(self._ask(Down.RESET, (recording.start, recording.instruments, packets.streams, homes)))
        self.observed = facts.get("observes")

    def run(self, packets: PacketEncoder, log: TrialLog) -> None:
        """Hand over all packets."""
        self._steps = len(packets)
        if self._together == 1:
            self._run_one_by_one(packets, log)
            return
        for first in range(0, len(packets), self._together):
            started, last = time.perf_counter(), min(first + self._together, len(packets))
            self._send(b"".join(packets.of(first, last)))
            reply = self._receive(LARGEST)
            seconds, place = [time.perf_counter() - started], 0
            if reply[0] == Up.ANSWERS:
                seconds = np.frombuffer(reply, np.float64, last - first, ANSWER.size).tolist()
                place = ANSWER.size + 8 * len(seconds)
            try:
                for each in seconds:
                    end = place + ANSWER.size + int(_SIZE.unpack_from(reply, place)[0])
                    if reply[place] != ESTIMATE:
                        self._refuse(reply[place:end])
                    log.put(reply[place:end], each)
                    place = end
            finally:
                log.settle()

    def _run_one_by_one(self, packets: PacketEncoder, log: TrialLog) -> None:
        """Hand over all packets of single steps; each is sent when the whole answer to the last one is here.

        Between two steps next to nothing is done, for the estimator finds the caches of the processor as this process
        left them. Packets are encoded, and answers judged, for up to `_STEPS` steps together.
        """
        write, read, ready, clock = os.write, os.read, self._readable.poll, time.perf_counter
        size_of, header, put = _SIZE.unpack_from, ANSWER.size, log.put
        for first in range(0, len(packets), _STEPS):
            began, held = clock(), 0
            for packet in [b"".join(packets[k]) for k in range(first, min(first + _STEPS, len(packets)))]:
                started = clock()
                try:
                    sent = write(self._write, packet)
                except BlockingIOError:
                    sent = 0
                except OSError:
                    raise self._gone() from None
                if sent != len(packet) or not ready(_LONGEST_HELD):
                    self._silent = True
                    log.settle()
                    self._send(packet[sent:])
                    self._wait(self._readable)
                    self._silent = False
                try:
                    reply = read(self._read, _PIECE)
                except BlockingIOError:
                    reply = self._piece()
                if len(reply) < header or len(reply) != header + size_of(reply)[0]:
                    reply = self._rest(reply, LARGEST)
                now = clock()
                if reply[0] != ESTIMATE:
                    self._refuse(reply)
                put(reply, now - started)
                held += len(reply)
                if held > _BYTES or now - began > _LONGEST_HELD / 1e3:
                    log.settle()
                    self._check_time()
                    began, held = now, 0
            log.settle()
            self._check_time()

    def smooth(self) -> NavigationStates | None:
        """The smoothed trajectory, or None."""
        self._send(command(Down.SMOOTH))
        reply = self._receive(max(LARGEST, _STATE * self._steps))
        if reply[0] == Up.DONE:
            return None
        if reply[0] != Up.TRAJECTORY:
            self._refuse(reply)
        return trajectory_in(reply[ANSWER.size :])

    def describe(self, error: BaseException) -> str:
        """What an exception says that was raised here."""
        return f"{type(error).__name__}: {error}"[:500]

    def end(self) -> None:
        """Say that this was all, if it listens."""
        if self._silent:
            return
        try:
            names = facts_in(self._ask(Down.END, None)).get("libraries", [])
        except (FailureError, InvalidOutputError):
            return
        if isinstance(names, list):
            self.libraries = [name for name in names if isinstance(name, str) and name in LIBRARIES]

    # -- the pipe ----------------------------------------------------------------------------------

    def _ask(self, kind: Down, body: Any) -> bytes:
        self._send(command(kind, pickle.dumps(body, protocol=pickle.HIGHEST_PROTOCOL)))
        reply = self._receive(LARGEST)
        if reply[0] != Up.DONE:
            self._refuse(reply)
        return reply

    def _refuse(self, reply: bytes) -> None:
        """Raise what an answer says that is not the one that was wanted."""
        if reply[0] == Up.FAILURE:
            with contextlib.suppress(ValueError, TypeError, RecursionError):
                status, reason = json.loads(reply[ANSWER.size :])
                if status in ("error", "invalid-output", "out-of-memory", "unsuitable") and isinstance(reason, str):
                    raise FailureError(status, " ".join(reason[:2000].split())[:1000])
        raise InvalidOutputError("the answer is not in the form of an estimate")

    def _send(self, message: bytes) -> None:
        rest = memoryview(message)
        while rest:
            self._wait(self._writable)
            try:
                rest = rest[os.write(self._write, rest) :]
            except BlockingIOError:
                continue
            except OSError:
                raise self._gone() from None

    def _receive(self, most: int) -> bytes:
        """One whole answer of at most so many bytes."""
        return self._rest(self._piece(), most)

    def _piece(self) -> bytes:
        """What is there next of an answer; nothing where the pipe is closed."""
        while True:
            self._wait(self._readable)
            with contextlib.suppress(BlockingIOError):
                return os.read(self._read, _PIECE)

    def _rest(self, reply: bytes, most: int) -> bytes:
        """The whole answer of which this is what came first."""
        pieces = bytearray(reply)
        while reply:
            if len(pieces) >= ANSWER.size:
                size = ANSWER.size + int(_SIZE.unpack_from(pieces)[0])
                if size > most:
                    raise InvalidOutputError(f"an answer of {size >> 20} MiB, more than {most >> 20} MiB")
                if len(pieces) > size:
                    raise InvalidOutputError("more than one answer to one step")
                if len(pieces) == size:
                    return bytes(pieces)
            reply = self._piece()
            pieces += reply
        raise self._gone()

    def _wait(self, poll: Any) -> None:
        while not poll.poll(max(0.0, min(1000.0 * (self._deadline - time.monotonic()) + 1.0, _TICK))):
            self._check_time()
        self._check_time()

    def _check_time(self) -> None:
        if time.monotonic() > self._deadline:
            self._silent = True
            raise StoppedError("timeout", f"stopped after {self.limits.timeout:g} s")

    def _gone(self) -> _GoneError:
        self._silent = True
        return _GoneError()


def _search_path() -> list[str]:
    """Where this process finds modules, for one in another folder: an empty entry is the folder that we are in."""
    return [os.path.abspath(entry) for entry in sys.path]
