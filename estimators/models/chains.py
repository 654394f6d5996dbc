"""The chains that come with simnav, for `simnav.estimators.models.chain.chain_of`."""

from __future__ import annotations

from simnav.estimators.models.chain import Chain, chain_of
from simnav.estimators.models.general import GeneralChain
from simnav.estimators.models.inertial_chain import InertialChain
from simnav.estimators.models.ship_chain import ShipChain

__all__ = ["Chain", "GeneralChain", "InertialChain", "ShipChain", "chain_of"]
