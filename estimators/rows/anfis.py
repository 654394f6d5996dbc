"""The neuro-fuzzy rows: a reconstruction of ANFIS-FGO, and the same adaptation in a filter."""

from simnav.estimator import register
from simnav.estimators.adaptations.anfis import Anfis
from simnav.estimators.composition import piece

from .kalman import ShipEkf
from .windows import ShipFgo

__all__ = ["AnfisEkf", "AnfisFgo", "AnfisFgoMotion"]


@register("anfis-fgo")
class AnfisFgo(ShipFgo, adaptation=Anfis):
    """ANFIS-FGO, a reconstruction: ``ship-fgo``, the noise of each fix chosen by a neuro-fuzzy network.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong, in several faults at a time
    or with a wrong datasheet (``python -m tests.audit silence`` counts such runs).

    The section on the network is missing from the text at hand; see ``docs/explanation/anfis.md``. Source: Jiang et
    al., *An improved factor graph optimization algorithm enhanced with ANFIS for ship GNSS/DR integrated navigation*,
    J. Mar. Sci. Eng. 14(5), 472, 2026, doi:10.3390/jmse14050472.

    Versions
    --------
    2
        The noise is relative to what the last innovations have where they contradict the datasheet
        (``level="learned"``). Before, the rows lost up to 39 % to ``ship-ekf`` where a datasheet is wrong.
    3
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    """

    version = 3


@register("anfis-fgo-motion")
class AnfisFgoMotion(ShipFgo, adaptation=piece(Anfis, features="motion")):
    """ANFIS-FGO, a reconstruction, with a network that sees the ship's motion only: ``anfis-fgo`` but for that.

    The ablation of ``anfis-fgo``. In our simulations GNSS noise knows nothing of the ship's motion, so that this
    network can learn no more than the mean. Source: *GNSS/DR integrated navigation for ships*, the paper that proposes
    ANFIS-FGO.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong, in several faults at a time
    or with a wrong datasheet (``python -m tests.audit silence`` counts such runs).

    Versions
    --------
    2
        The noise is relative to what the last innovations have where they contradict the datasheet
        (``level="learned"``). Before, the rows lost up to 39 % to ``ship-ekf`` where a datasheet is wrong.
    3
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    """

    version = 3


@register("anfis-ekf")
class AnfisEkf(ShipEkf, adaptation=Anfis):
    """The network of ``anfis-fgo`` (a reconstruction) in ``ship-ekf``: what it does without the graph.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong, in several faults at a time
    or with a wrong datasheet (``python -m tests.audit silence`` counts such runs).

    Source: *GNSS/DR integrated navigation for ships*, the paper that proposes ANFIS-FGO.

    Versions
    --------
    2
        The noise is relative to what the last innovations have where they contradict the datasheet
        (``level="learned"``). Before, the rows lost up to 39 % to ``ship-ekf`` where a datasheet is wrong.
    3
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    """

    version = 3
