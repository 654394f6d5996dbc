"""The chains that come with simnav, for `simnav.estimators.models.chain.chain_of`."""

from __future__ import annotations

from .chain import Chain, chain_of
from .general import GeneralChain
from .inertial_chain import InertialChain
from .ship_chain import ShipChain

__all__ = ["Chain", "GeneralChain", "InertialChain", "ShipChain", "chain_of"]
