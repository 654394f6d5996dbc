"""The contract of estimators: a class with two methods, `Estimator.reset` and `Estimator.update`."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from simnav.estimator.needs import Needs
from simnav.plugins import PluginError
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements, NavigationStates

if TYPE_CHECKING:
    from simnav.estimates import Estimates
    from simnav.recording import Recording
    from simnav.steps import Steps

__all__ = ["Estimator", "EstimatorError", "UnsuitableScenario"]


class Estimator(ABC):
    """Base class of all estimators.

    The constructor takes the parameters, all with defaults, as keyword arguments; ``--set name=value``
    on the command line sets them. One instance can process many runs; `reset` starts each of them.

    Attributes
    ----------
    name : str
        Name of the estimator; `register` sets it.
    reference : bool
        True for rows that receive the truth (oracles). They are marked and not ranked, and
        `reveal` is called before `reset`.
    slow : bool
        True for rows that take several milliseconds an epoch or more. A quick campaign runs them only if they are
        named.
    advised_against : bool
        True for a row whose page says where not to use it, and that a recommendation never names. It is ranked.
    real_time_as : str
        Name of another estimator whose real-time estimates are the same bit for bit, if this one only adds smoothing;
        otherwise empty. Boards then rank this estimator by its smoothed trajectory only.
    version : int
        Version of its numbers, from 1. It is raised whenever a change of code alters an estimate, and is stored with
        each result. A version after 1 has a line in the section ``Versions`` of the docstring, which says what changed.
        A class has its own; that of its base is not inherited.
    formerly : mapping of str to str
        Former names of parameters, and the present ones: ``{"window": "innovations"}``. `simnav.estimator.make` reads
        the former ones, and so do the constructors of rows. Results and tuned files of simnav's rows are shown under
        the present ones.
    """

    name: ClassVar[str] = ""
    reference: ClassVar[bool] = False
    slow: ClassVar[bool] = False
    advised_against: ClassVar[bool] = False
    real_time_as: ClassVar[str] = ""
    version: ClassVar[int] = 1
    formerly: ClassVar[Mapping[str, str]] = {}

    def __init_subclass__(cls, **options: Any):
        super().__init_subclass__(**options)
        cls.version = vars(cls).get("version", 1)

    @property
    def needs(self) -> Needs:
        """The instruments without which the estimator cannot work, e.g. ``needs = ("imu", "gnss_position")``.

        Each entry is a kind of instrument, ``"imu"``, ``"aid"`` (any instrument beside the IMU), or a tuple of these of
        which one is enough. The estimator is not run on a scenario that lacks one of them. If it refuses a scenario
        that has them all, the run is a failure. By default nothing is needed.
        """
        return ()

    def observes(self, instruments: Instruments) -> Collection[str] | None:
        """Return the names of the instruments whose readings it uses; None if it does not say.

        If some of the instruments give a position (`simnav.kinds.Datasheet.gives_position`) and none of these is among
        the names, the scenario is unsuitable. By default, and for dead reckoning, which uses no position by design, it
        is None.

        Parameters
        ----------
        instruments : Instruments
            Those of the run, as for `reset`. All that `needs` names are there.
        """
        return None

    @property
    def learned_from(self) -> Sequence[tuple[int, int]]:
        """The runs from which the parameters were learned, as pairs of a first and a last number.

        The numbers are those from which the random streams of the runs start, `simnav.scenario.Scenario.root` of their
        seeds. A campaign refuses to score an estimator on a run in one of these ranges. By default there is none.
        """
        return ()

    @abstractmethod
    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Start a run.

        Parameters
        ----------
        start : InitialState
            Initial state, with errors drawn from its covariance.
        instruments : Instruments
            The datasheets. They do not contain the true errors.

        Raises
        ------
        UnsuitableScenario
            If an instrument that `needs` names is missing. simnav itself does not call `reset` in this case.
        """

    @abstractmethod
    def update(self, measurements: Measurements) -> Estimate:
        """Process the measurements of one step; return the estimate at the end of the step."""

    def update_all(self, steps: Steps) -> Estimates | None:
        """Process several steps by one call, with the numbers of `update` step by step.

        None, and nothing done, if they have to be processed one by one, as they are by default. simnav's filters do
        this where all their functions are kernels; an estimator that is made of them need not define it.

        Parameters
        ----------
        steps : Steps
            At least one step. A campaign hands over several steps only to estimators that come with simnav, because
            they could otherwise look ahead.
        """
        return None

    def smooth(self) -> NavigationStates | None:
        """Return the smoothed trajectory at the ends of all steps, after the last update; None without smoothing."""
        return None

    def earlier(self, lags: Sequence[float]) -> Array | None:
        """Return the states of earlier times, from all measurements so far; None if the estimator does not look back.

        It is called after each update of a run with ``lags`` (`simnav.estimator.looking_back`), always with the same
        lags. The window of a graph holds such states, and a filter computes them by a fixed-lag smoother.

        Parameters
        ----------
        lags : sequence of float
            Times before the end of the step [s], multiples of the step.

        Returns
        -------
        (k, 9) array or None
            One row for each lag: latitude, longitude [rad], height [m]; velocity north-east-down [m/s]; roll, pitch,
            yaw [rad]. NaN in components that are not estimated, and in rows of times before the first step.

        Raises
        ------
        ValueError
            If a lag is longer than the estimator can look back; one sentence.
        """
        return None

    def longest_lag(self, instruments: Instruments) -> float:
        """Return the longest lag that `earlier` can answer [s], so that a longer one is refused before a run.

        Parameters
        ----------
        instruments : Instruments
            Those of the run.
        """
        return math.inf

    def reveal(self, recording: Recording) -> None:  # noqa: B027 (a hook: most estimators are told nothing)
        """Receive the recording with truth and labels, before `reset`. Only ``reference`` estimators get it."""


class UnsuitableScenario(Exception):  # noqa: N818 (not an error of the estimator's)
    """Raised by `Estimator.reset` if an instrument that `Estimator.needs` names is missing."""


class EstimatorError(PluginError):
    """An estimator cannot be registered, found or constructed. The message is one sentence."""
