"""A trained policy as an estimator: the filter of its task, with the policy's decisions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from simnav.estimator import Estimator, UnsuitableScenario
from simnav.estimator.needs import Needs
from simnav.estimators.fix_test import FixTest
from simnav.estimators.models.channels import by_channel
from simnav.estimators.models.suitable import Suitable
from simnav.types import KINDS, Array, Estimate, InitialState, Instruments, Measurements

from .features import Context
from .filters import Filters, Layout
from .policy import Policy, PolicyError
from .reference import ReferenceFilter
from .tasks import TASKS

__all__ = ["PolicyEstimator"]

_ON = np.ones(1, np.bool_)


class PolicyEstimator(Estimator):
    """The filter of a learning task under a policy: the numbers of the environment that it was trained in.

    Parameters
    ----------
    file : str
        Of the policy (`simnav.estimators.learning.policy`).

    Raises
    ------
    PolicyError
        If the file cannot be used.
    """

    def __init__(self, file: str):
        self.policy = Policy.load(Path(file).expanduser())
        if self.policy.task not in TASKS:
            raise PolicyError(f"{file}: a policy of {self.policy.task} steers a vessel and estimates nothing")

    @property
    def needs(self) -> Needs:
        """What the plain filter needs, and an instrument of a kind that the policy is asked about."""
        return (*Suitable().needs, tuple(self.policy.kinds))

    @property
    def learned_from(self) -> Sequence[tuple[int, int]]:
        """The training voyages, as its file tells them."""
        return self.policy.learned_from

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario where there is no instrument of its kinds.

        The policy is asked about the first instrument, or channel, of each of its kinds; all others keep their noise.
        Of a kind that is not there it sees what it saw in training: zeros.
        """
        policy, instruments = self.policy, by_channel(instruments)
        self._fix_test = FixTest(instruments)
        self._filter = ReferenceFilter(list(instruments))
        self._filter.reset(start, instruments)
        names: list[str] = []
        for kind in policy.kinds:
            own = (n for n in self._filter.watched if instruments[n].kind == kind and n not in names)
            names.append(next(own, f"no {kind}"))
        if not set(names) & set(instruments):
            raise UnsuitableScenario(f"{policy.source}: it was trained for {', '.join(policy.kinds)}; there is none")
        kinds, every = policy.kinds, list(instruments)
        layout = Layout(every, names, kinds, policy.most, self._filter.model.size, 0.0)
        self._instruments, self._layout = instruments, layout
        task = TASKS[policy.task](layout.names, layout.most)
        self._filters = Filters(task, layout, task.rewards[0], 1, self._filter.model.size)
        self._filters.begin(0, self._filter.start_covariance, layout.periods(instruments))
        self._context = Context(start, instruments.step)
        self._first, self._last = np.zeros(1, np.int64), np.zeros(1, np.int64)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, as the policy decides."""
        context = self._context.numbers()[None]
        plain = self._filter.update(measurements)
        self._context.move(plain)
        linear, filters = self._filter.linear, self._filters
        self._last[0] = self._filter.count
        filters.observe(linear, self._first, self._last, np.array([plain.time]), context, _ON)
        filters.decide(np.asarray(self.policy(filters.observation[:1]), dtype=np.float64))
        filters.step(linear, self._first, self._last, _ON)
        model = self._filter.model
        before = model.snapshot()
        model.correct(self._shift())
        estimate = model.estimate(filters.covariance[0])
        model.restore(before)
        estimate.diagnostics = self._sigmas()
        estimate.flagged = self._flagged(measurements)
        return self._fix_test.judge(measurements, estimate)

    def _shift(self) -> Array:
        """From the plain filter's state to the policy's."""
        shift: Array = self._filters.delta[0].copy()
        correction = self._filters.decision.correction[0]
        if self.policy.task == "Correction":
            at = self._filter.model.attitude_at
            if at is None:
                raise UnsuitableScenario("a policy of Correction needs a filter over an IMU")
            shift[:6] += correction[:6]
            shift[at + 2] += correction[6]
        return shift

    def _sigmas(self) -> dict[str, float | Array]:
        """The sigmas in use, as the adaptive filters report theirs."""
        used: dict[str, float | Array] = {}
        for i, name in enumerate(self._layout.names):
            if name not in self._instruments:
                continue
            sheet, factor = self._instruments[name], float(self._filters.decision.scale[0, i, 0])
            for component, sigma in zip(KINDS[sheet.kind].errors, sheet.sigma.tolist(), strict=True):
                used[f"sigma_{component}.{name}"] = factor * sigma
        used["process_noise"] = float(self._filters.decision.process_scale[0])
        return used

    def _flagged(self, measurements: Measurements) -> list[tuple[str, float]]:
        if self.policy.task != "Detection":
            return []
        counts = dict.fromkeys(self._layout.names, 0)
        flagged = []
        for m in measurements:
            name = m.source
            if name in counts:
                j = min(counts[name], self._layout.most - 1)
                counts[name] += 1
                if self._filters.decision.scale[0, self._layout.names.index(name), j] <= 0.0:
                    flagged.append((name, m.time))
        return flagged
