"""What an estimator is: a class with two methods, `Estimator.reset` and `Estimator.update`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from simnav.estimator.needs import Needs
from simnav.plugins import PluginError
from simnav.types import Estimate, InitialState, Instruments, Measurements, NavigationStates

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["Estimator", "EstimatorError", "UnsuitableScenario"]


class Estimator(ABC):
    """Base class of all estimators.

    The constructor takes the parameters, all with defaults, as keyword arguments; ``--set name=value``
    on the command line sets them. One instance serves many runs, each begun by `reset`.

    Attributes
    ----------
    name : str
        Set by `register`.
    reference : bool
        True for rows that are told the truth (an oracle); they are marked and not ranked, and
        `reveal` is called before `reset`.
    slow : bool
        True for rows that take several milliseconds an epoch or more; a quick campaign leaves them out unless it is
        asked for them.
    real_time_as : str
        Name of the estimator whose real-time estimates this one gives, to the bit, and only smooths beside; empty for
        all others. Boards then rank it by what it smooths.
    """

    name: ClassVar[str] = ""
    reference: ClassVar[bool] = False
    slow: ClassVar[bool] = False
    real_time_as: ClassVar[str] = ""

    @property
    def needs(self) -> Needs:
        """The instruments without which it cannot work; a class may simply say ``needs = ("imu", "gnss_position")``.

        Each entry is a kind of instrument, ``"imu"``, ``"aid"`` (any instrument beside the IMU), or a tuple of these of
        which one is enough. The harness gives it no scenario that lacks one of them. To refuse a scenario that has them
        all is a failure. By default nothing is needed.
        """
        return ()

    @property
    def learned_from(self) -> Sequence[tuple[int, int]]:
        """The runs that its parameters were learned from: pairs of a first and a last number.

        The numbers are those that the random streams of the runs start from, `simnav.scenario.Scenario.root` of their
        seeds. A campaign refuses to score an estimator on a run in one of these ranges. By default there is none.
        """
        return ()

    @abstractmethod
    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run.

        Parameters
        ----------
        start : InitialState
            A state with errors drawn from its covariance.
        instruments : Instruments
            The datasheets, never the realised errors.

        Raises
        ------
        UnsuitableScenario
            If an instrument is lacking that `needs` names, where the estimator is used without the harness.
        """

    @abstractmethod
    def update(self, measurements: Measurements) -> Estimate:
        """Take what the instruments delivered in one step; return the estimate at its end."""

    def smooth(self) -> NavigationStates | None:
        """After the last update: the whole trajectory, smoothed, at the ends of all steps; or None."""
        return None

    def reveal(self, recording: Recording) -> None:  # noqa: B027 (a hook: most estimators are told nothing)
        """Only for ``reference`` estimators: the recording with truth and labels, before `reset`."""


class UnsuitableScenario(Exception):  # noqa: N818 (not an error of the estimator's)
    """Raised by `Estimator.reset`: an instrument that `Estimator.needs` names is not there."""


class EstimatorError(PluginError):
    """An estimator that cannot be registered, found or made; the message is one sentence."""
