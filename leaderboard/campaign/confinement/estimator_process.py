"""The life of an estimator process: made, reset, fed step by step, gone. It never holds a recording."""

from __future__ import annotations

import copy
import json
import pickle
import random
import sys
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.estimator import Estimator, EstimatorError, UnsuitableScenario
from simnav.estimator.looking_back import inner_of
from simnav.leaderboard.campaign.fingerprint import own_code
from simnav.leaderboard.campaign.request import file_of
from simnav.leaderboard.campaign.sources import kernel_modules
from simnav.leaderboard.campaign.training_runs import declared_ranges
from simnav.leaderboard.results.errors import named
from simnav.trial import answers_to, describe_failure
from simnav.trial.wire import VECTORS, EstimateEncoder, InvalidOutputError, PacketDecoder, real_array
from simnav.types import NavigationStates

from .kinds import load_kinds
from .messages import Down, Up, answer, read_message, write_all

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.entrant import Entrant

__all__ = ["LIBRARIES", "live", "seed_generators"]

#: What estimators import late; a server that has it already starts the next one sooner.
LIBRARIES = frozenset({
    "filterpy", "filterpy.kalman", "gtsam", "pandas", "scipy.interpolate", "scipy.linalg", "scipy.optimize",
    "scipy.signal", "scipy.sparse", "scipy.sparse.linalg", "scipy.spatial", "scipy.special", "scipy.stats",
})  # fmt: skip


def live(down: int, up: int) -> None:
    """Answer all messages until the end.

    Parameters
    ----------
    down, up : int
        Descriptors of the pipe from the worker and of that to it.
    """
    session = _Session()
    while True:
        found = read_message(down)
        if found is None:
            return
        kind, message = found
        if not kind:
            reply = session.step(message)
        elif kind == Down.MAKE:
            reply = session.make(bytes(message[PacketDecoder.HEADER :]))
        elif kind == Down.RESET:
            reply = session.reset(bytes(message[PacketDecoder.HEADER :]))
        elif kind == Down.SMOOTH:
            reply = session.smooth()
        elif kind == Down.DESCRIBE:
            reply = session.describe(bytes(message[PacketDecoder.HEADER :]))
        else:
            write_all(up, session.end())
            return
        write_all(up, reply)


class _Session:
    """The estimator and what is said of it. Each method has the same depth of calls, for `describe_failure`."""

    def __init__(self) -> None:
        self._estimator: Any = None
        self._encode = EstimateEncoder()
        self._decode = PacketDecoder(())
        self._before = _loaded_libraries()

    def make(self, body: bytes) -> bytes:
        """Import and construct the estimator; of a file or a session that is the first time that its code runs."""
        try:
            self._estimator = _entrant(body).make()
            made = inner_of(self._estimator)
            facts = {"name": made.name or type(made).__name__, "needs": self._estimator.needs}
        except MemoryError:
            return _failure("out-of-memory", "more memory was wanted")
        except BaseException as error:  # SystemExit and KeyboardInterrupt, too: it is not the user who asks
            return _failure("error", named(error))
        return answer(Up.DONE, json.dumps(facts, default=repr).encode())

    def describe(self, body: bytes) -> bytes:
        """What the estimator is; a failure where it cannot be found, or what was asked for does not fit."""
        try:
            entrant = _entrant(body)
            cls = entrant.find()
            facts = {
                "reference": bool(cls.reference), "source": own_code(cls), "learned_from": [],
                "version": cls.version, "kernels": kernel_modules(file_of(entrant.name)),
            }  # fmt: skip
            try:
                made = entrant.make()
                facts["learned_from"] = declared_ranges(made)
                facts["needs"] = made.needs
            except Exception as error:  # of its constructor: each run will say so
                if isinstance(error, EstimatorError) and (error.__cause__ is None or entrant.parameters):
                    raise  # what was asked for does not fit
        except BaseException as error:
            return _failure("error", named(error))
        return answer(Up.DONE, json.dumps(facts, default=repr).encode())

    def reset(self, body: bytes) -> bytes:
        try:
            start, instruments, streams, homes = pickle.loads(body)
        except BaseException as error:
            return _failure("error", named(error))
        self._decode = PacketDecoder(streams)
        try:
            load_kinds(homes)
            observed = self._estimator.observes(copy.deepcopy(instruments))
            self._estimator.reset(start, instruments)
            names = isinstance(observed, Collection) and not isinstance(observed, str)
            told = list(observed) if names else observed
            facts = json.dumps({"observes": told}, default=repr)
        except BaseException as error:
            return self._raised(error)
        return answer(Up.DONE, facts.encode())

    def step(self, packet: bytearray) -> bytes:
        """The answer to a packet of one step; of several the times that they took, and the answers behind them."""
        answers: list[bytes] = []
        seconds: list[float] = []
        steps = self._decode(packet)
        try:
            for more, each in answers_to(self._estimator, steps, self._encode):
                answers += more
                seconds += [each] * len(more)
        except BaseException as error:
            answers.append(self._raised(error))
        if len(steps) == 1:
            return answers[0]
        seconds += [0.0] * (len(steps) - len(seconds))
        return answer(Up.ANSWERS, b"".join([np.array(seconds).tobytes(), *answers]))

    def smooth(self) -> bytes:
        try:
            states = self._estimator.smooth()
            if states is None:
                return answer(Up.DONE)
            if not isinstance(states, NavigationStates):
                raise InvalidOutputError(f"expected NavigationStates or None, got {type(states).__name__}")
            arrays = [real_array(getattr(states, name), name, None) for name in ("time", *VECTORS)]
        except BaseException as error:
            return self._raised(error)
        shapes = json.dumps([a.shape for a in arrays]).encode()
        return answer(Up.TRAJECTORY, b"".join([len(shapes).to_bytes(8), shapes, *(a.tobytes() for a in arrays)]))

    def end(self) -> bytes:
        """What should be imported before the next one is forked."""
        new = _loaded_libraries() - self._before
        return answer(Up.DONE, json.dumps({"libraries": sorted(new)}).encode())

    def _raised(self, error: BaseException) -> bytes:
        if isinstance(error, InvalidOutputError):
            return _failure("invalid-output", str(error))
        if isinstance(error, UnsuitableScenario):
            return _failure("unsuitable", str(error))
        status = "out-of-memory" if isinstance(error, MemoryError) else "error"
        estimator: Estimator = self._estimator
        return _failure(status, describe_failure(error, estimator, skip=1))


def _loaded_libraries() -> set[str]:
    return {name for name in LIBRARIES if name in sys.modules}  # a look at each name of a module would copy its page


def _failure(status: str, reason: str) -> bytes:
    return answer(Up.FAILURE, json.dumps([status, reason[:2000]]).encode())


def _entrant(body: bytes) -> Entrant:
    """Which estimator it is about; this process then finds modules, and draws numbers, as it should."""
    entrant, path, words = pickle.loads(body)
    sys.path[:] = [*entrant.search, *path]
    seed_generators(words)
    return entrant  # type: ignore[no-any-return]


def seed_generators(words: list[int]) -> None:
    """Whoever draws from a global generator gets the same numbers in every campaign, and learns nothing from them."""
    random.seed(sum(word << 32 * k for k, word in enumerate(words)))
    np.random.seed(words)  # noqa: NPY002
