"""The reference estimators: models, solvers and adaptations, and the rows that combine them.

Importing the package registers the rows; compiled code and large libraries load when an estimator first runs.
"""

from estimators.adaptive import (
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
from estimators.anfis_rows import AnfisEkf, AnfisFgo, AnfisFgoMotion
from estimators.dead_reckoning import DeadReckoning
from estimators.ekf import Ekf
from estimators.ekf_presets import Ekf9, Ekf23
from estimators.federated import Federated, FederatedNoReset
from estimators.filterpy_rows import FilterpyUkf
from estimators.gnss_only import GnssOnly
from estimators.gtsam_rows import GtsamBatch, GtsamFixedLag, GtsamGnc, GtsamIsam2
from estimators.inertial import PureInertial
from estimators.invariant import InvariantEkf
from estimators.iterated import IteratedEkf
from estimators.kf import Kf, Kf23
from estimators.oracle import Oracle
from estimators.references import OracleClairvoyant, OracleMixture, OracleRts
from estimators.robust_graphs import (
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
from estimators.ship_ekf import ShipEkf
from estimators.ship_graphs import ShipFgo, ShipFgoFull
from estimators.sigma_point import Ckf, ShipCkf, ShipUkf, Ukf
from estimators.sliding_window import FgoFull, FgoUnsimplified, IaeFgo, IaeFgoFixed, SwFgo
from estimators.smoothers import EkfRts, EkfTwoFilter, ShipEkfRts

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
