"""Sweeps: the error of estimators against a dial of a scenario, and where each of them breaks."""

from __future__ import annotations
