"""The reference estimators: models, solvers and adaptations, and the rows that combine them.

Importing the package registers the rows; compiled code and large libraries load when an estimator first runs.
"""

from simnav.estimators.adaptive import (
    Adkf,
    AdkfPaper,
    FadingEkf,
    GatedEkf,
    HuberKf,
    Iae,
    IaeFixed,
    Igg3,
    Imm,
    Mckf,
    Rae,
    SageHusaKf,
    SageHusaPaper,
    VbAkf,
)
from simnav.estimators.anfis_rows import AnfisEkf, AnfisFgo, AnfisFgoMotion
from simnav.estimators.ekf import Ekf
from simnav.estimators.ekf_presets import Ekf9, Ekf23
from simnav.estimators.federated import Federated, FederatedNoReset
from simnav.estimators.filterpy_rows import FilterpyUkf
from simnav.estimators.gnss_only import GnssOnly
from simnav.estimators.gtsam_rows import GtsamBatch, GtsamFixedLag, GtsamGnc, GtsamIsam2
from simnav.estimators.inertial import PureInertial
from simnav.estimators.invariant import InvariantEkf
from simnav.estimators.iterated import IteratedEkf
from simnav.estimators.kf import Kf, Kf23
from simnav.estimators.oracle import Oracle
from simnav.estimators.references import OracleClairvoyant, OracleMixture, OracleRts
from simnav.estimators.robust_graphs import (
    CauchyFgo,
    DcsFgo,
    GaFgo,
    GaFgoPaper,
    GmFgo,
    GncFgo,
    HuberFgo,
    MaxMixtureFgo,
    SwFgoPaper,
    SwitchableFgo,
    TukeyFgo,
)
from simnav.estimators.ship_ekf import ShipEkf
from simnav.estimators.ship_graphs import ShipFgo, ShipFgoFull
from simnav.estimators.sigma_point import Ckf, ShipCkf, ShipUkf, Ukf
from simnav.estimators.sliding_window import FgoFull, FgoUnsimplified, IaeFgo, IaeFgoFixed, SwFgo
from simnav.estimators.smoothers import EkfRts, EkfTwoFilter, ShipEkfRts
from simnav.estimators.solvers.dead_reckoning import DeadReckoning

__all__ = [
    "Adkf",
    "AdkfPaper",
    "AnfisEkf",
    "AnfisFgo",
    "AnfisFgoMotion",
    "CauchyFgo",
    "Ckf",
    "DcsFgo",
    "DeadReckoning",
    "Ekf",
    "Ekf9",
    "Ekf23",
    "EkfRts",
    "EkfTwoFilter",
    "FadingEkf",
    "Federated",
    "FederatedNoReset",
    "FgoFull",
    "FgoUnsimplified",
    "FilterpyUkf",
    "GaFgo",
    "GaFgoPaper",
    "GatedEkf",
    "GmFgo",
    "GncFgo",
    "GnssOnly",
    "GtsamBatch",
    "GtsamFixedLag",
    "GtsamGnc",
    "GtsamIsam2",
    "HuberFgo",
    "HuberKf",
    "Iae",
    "IaeFgo",
    "IaeFgoFixed",
    "IaeFixed",
    "Igg3",
    "Imm",
    "InvariantEkf",
    "IteratedEkf",
    "Kf",
    "Kf23",
    "MaxMixtureFgo",
    "Mckf",
    "Oracle",
    "OracleClairvoyant",
    "OracleMixture",
    "OracleRts",
    "PureInertial",
    "Rae",
    "SageHusaKf",
    "SageHusaPaper",
    "ShipCkf",
    "ShipEkf",
    "ShipEkfRts",
    "ShipFgo",
    "ShipFgoFull",
    "ShipUkf",
    "SwFgo",
    "SwFgoPaper",
    "SwitchableFgo",
    "TukeyFgo",
    "Ukf",
    "VbAkf",
]
