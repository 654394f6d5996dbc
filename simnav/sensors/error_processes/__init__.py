"""The error processes of instruments: what a table ``[[instruments.NAME.error]]`` may be.

One file a kind: ``white``, ``heavy_tailed``, ``constant``, ``gauss_markov``, ``gauss_markov_2``, ``random_walk``,
``settling``, ``ballistic``, ``quantised`` and ``loss``. `register_error_process` registers one more, and
`register_factor` one more factor.
"""

from __future__ import annotations

from typing import Annotated

from simnav.sensors.error_processes.constant import Constant
from simnav.sensors.error_processes.factors import FACTORS, Factors, named_factors, register_factor
from simnav.sensors.error_processes.gauss_markov import GaussMarkov
from simnav.sensors.error_processes.gauss_markov_2 import GaussMarkov2
from simnav.sensors.error_processes.heavy_tailed import HeavyTailed
from simnav.sensors.error_processes.loss import Loss
from simnav.sensors.error_processes.process import (
    ERROR_PROCESSES,
    ErrorProcessSpec,
    Figure,
    Sampled,
    figure,
    register_error_process,
)
from simnav.sensors.error_processes.quantised import Quantised
from simnav.sensors.error_processes.random_walk import RandomWalk
from simnav.sensors.error_processes.settling import Ballistic, Settling
from simnav.sensors.error_processes.total import TotalError, declared_processes, in_sea, labels_of, white_of
from simnav.sensors.error_processes.white import White
from simnav.spec import OneOf

__all__ = [
    "ERROR_PROCESSES",
    "FACTORS",
    "AnyErrorProcess",
    "Ballistic",
    "Constant",
    "ErrorProcessSpec",
    "Factors",
    "Figure",
    "GaussMarkov",
    "GaussMarkov2",
    "HeavyTailed",
    "Loss",
    "Quantised",
    "RandomWalk",
    "Sampled",
    "Settling",
    "TotalError",
    "White",
    "declared_processes",
    "error_process_specs",
    "figure",
    "in_sea",
    "labels_of",
    "named_factors",
    "register_error_process",
    "register_factor",
    "white_of",
]


def error_process_specs() -> list[type[ErrorProcessSpec]]:
    """The specifications of all registered kinds of error processes."""
    return list(ERROR_PROCESSES.items().values())


#: Any registered error process; its ``kind`` decides the class.
AnyErrorProcess = Annotated[ErrorProcessSpec, OneOf(error_process_specs)]
