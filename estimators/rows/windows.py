"""Factor graphs with every measurement at its nominal noise, or at a noise estimated from innovations."""

from simnav.estimator import register
from simnav.estimators.adaptations.innovation_based import FixedWindow, InnovationBased
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.full_graph import FullGraph
from simnav.estimators.solvers.window import WindowEstimator

from .adaptive import INNOVATIONS_AS_PRINTED

__all__ = ["FgoFull", "FgoUnsimplified", "IaeFgo", "IaeFgoFixed", "IaeFgoPaper", "ShipFgo", "ShipFgoFull", "SwFgo"]
__all__ += ["SwFgoPaper"]

_WINDOW = piece(WindowEstimator, every_sample=False)


@register("sw-fgo", aliases=("fgo", "fgo-simplified"))
class SwFgo(Row, solver=_WINDOW, model=InertialModel):
    """Sliding-window factor graph: preintegrated IMU factors, every measurement with its nominal noise.

    It assumes that the IMU is as its datasheet says. Do not use it where the IMU may be disturbed: the contradiction
    is frozen in the prior when its nodes leave. On ``lone-dvl`` (gyroscopes disturbed for a second, seeds 700 to 723)
    its error is 6.9 times that of ``ekf``, and 1.2 times with ``prior="group"``
    (`simnav.estimators.models.group_prior`).

    SW-FGO of M. Guo, B. Wang, L. Wei et al., *Robust INS/GNSS/DVL integrated navigation for MASS based on
    gradient-adaptive factor graph optimization*, 2026; the simplified graph of *Post-processing algorithm based on
    factor graph optimization for AUV integrated navigation*: a node per measurement, one equivalent IMU factor between.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("fgo-unsimplified")
class FgoUnsimplified(
    Row, solver=piece(WindowEstimator, defaults={"window": 5}, every_sample=True), model=InertialModel
):
    """The sliding window with a node for every IMU sample: the graph without the equivalent IMU factor.

    The same estimate as ``sw-fgo`` at many times its cost, which is what it is for. A shorter window keeps that
    bearable: 5 epochs are 500 nodes and more. Source: *Post-processing algorithm based on factor graph optimization for
    AUV integrated navigation*.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2

    slow = True


@register("fgo-full")
class FgoFull(Row, solver=FullGraph, model=InertialModel):
    """The full graph: every step estimates the whole trajectory; after the run, the batch solution is its smoother.

    Source: F. Dellaert and M. Kaess, *Factor graphs for robot perception*, Foundations and Trends in Robotics 6, 2017.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("iae-fgo")
class IaeFgo(Row, solver=_WINDOW, model=Suitable, adaptation=piece(InnovationBased, source="innovation")):
    """The sliding window with innovation-based estimation of the noise over a window that adapts its length.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Source: G. Mao, K. Wang, T. Fu, *Robust GNSS/INS integrated navigation algorithm based on adaptive factor graph
    optimization*, 2025, eqs. 16-20.

    Versions
    --------
    2
        Windows, priors and forgetting are in seconds for an instrument of more than 1 Hz. Innovations that persist
        while no other instrument contradicts them are taken as a wrong prediction, and not as noise (`PredictionTest`).
    3
        A lasting error is blamed on an instrument only by a witness, whatever its size. Before, one that an IMU of 20
        times the noise of its datasheet did not explain was taken for the instrument's. Depth sensors are tested, too.
        Fixes that see no error of a log at first may see it later. A log without fixes is believed from its second
        failure in one direction on, and a compass while another instrument finds the prediction wrong.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        Innovations of a log that persist are taken as a wrong prediction, whatever its witnesses say, if they grew
        little by little: an instrument that begins to be wrong is wrong at once (`simnav.estimators.onset`).
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("iae-fgo-paper")
class IaeFgoPaper(Row, solver=_WINDOW, model=Suitable, adaptation=INNOVATIONS_AS_PRINTED):
    """The sliding window with innovation-based estimation of the noise of fixes as its paper prints it (``iae-paper``).

    Source: G. Mao, K. Wang, T. Fu, *Robust GNSS/INS integrated navigation algorithm based on adaptive factor graph
    optimization*, 2025, eqs. 16-20.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("iae-fgo-fixed")
class IaeFgoFixed(Row, solver=_WINDOW, model=Suitable, adaptation=piece(FixedWindow, source="innovation")):
    """The sliding window with innovation-based estimation of the measurement noise over a fixed number of innovations.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    IAE-FGO-Fix of G. Mao, K. Wang, T. Fu, *Robust GNSS/INS integrated navigation algorithm based on adaptive factor
    graph optimization*, 2025.

    Versions
    --------
    2
        Windows, priors and forgetting are in seconds for an instrument of more than 1 Hz. Innovations that persist
        while no other instrument contradicts them are taken as a wrong prediction, and not as noise (`PredictionTest`).
    3
        A lasting error is blamed on an instrument only by a witness, whatever its size. Before, one that an IMU of 20
        times the noise of its datasheet did not explain was taken for the instrument's. Depth sensors are tested, too.
        Fixes that see no error of a log at first may see it later. A log without fixes is believed from its second
        failure in one direction on, and a compass while another instrument finds the prediction wrong.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("sw-fgo-paper")
class SwFgoPaper(
    Row,
    solver=piece(WindowEstimator, defaults={"tolerance": 1e-6, "spacing": 0.2}, every_sample=False),
    model=NineStateModel,
):
    """Sliding-window factor graph as its paper has it: 9 states, fixed sigmas, no biases.

    See `simnav.estimators.models.nine_state` for what is settled of the print, and how. Source: M. Guo, B. Wang, L. Wei
    et al., *Robust INS/GNSS/DVL integrated navigation for MASS based on gradient-adaptive factor graph optimization*,
    2026.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("ship-fgo")
class ShipFgo(Row, solver=_WINDOW, model=ShipModel):
    """Sliding-window factor graph on GNSS, compass and log, for a ship without an INS: the states of ``ship-ekf``.

    GNSS factors, DR factors (the motion between epochs, driven by log and compass), DR error factors, and the
    marginalization factor that older epochs leave behind. The DR error factor, a random walk of the log and compass
    biases in print, is the Gauss-Markov motion of the bias states that the datasheets ask for
    (`simnav.estimators.models.ship`); a bias that they call constant does not walk. Source: *GNSS/DR integrated
    navigation for ships*, the paper that proposes ANFIS-FGO.
    """


@register("ship-fgo-full")
class ShipFgoFull(Row, solver=FullGraph, model=ShipModel):
    """Full factor graph of a ship without an INS: every epoch since the start is estimated anew at every epoch.

    The graph of ``ship-fgo`` without a window. It begins each epoch where it was at the last one, so that few
    iterations suffice; its cost still grows with the square of the length. After the run it returns the batch solution.
    Source: *GNSS/DR integrated navigation for ships*, the paper that proposes ANFIS-FGO.
    """
