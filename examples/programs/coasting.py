"""Runs the program beside it: ``simnav run open-sea --estimator examples/programs/coasting.py``."""

from __future__ import annotations

from simnav.estimator import register
from simnav.estimator.program import ProgramEstimator


@register("coasting-program")
class CoastingProgram(ProgramEstimator):
    """Coasting between fixes of GNSS, in C++; compile ``coasting.cpp`` first."""

    program = "coasting"
    needs = ("gnss_position",)
