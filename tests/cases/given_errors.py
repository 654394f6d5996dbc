"""A small synthetic recording, and trials with errors that a test chooses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, rpy_from_dcm
from simnav.labels import FaultLabel
from simnav.recording import AidStream, Block, Recording
from simnav.trial import Trial
from simnav.types import Datasheet, InitialState, Instruments, NavigationStates

START = np.array([np.radians(60.0), np.radians(179.9999), -20.0])
SPEED = 5.0


def make_recording(steps: int = 100, outages: Any = (), faulty: Any = ()) -> Recording:
    """East at 5 m/s across the date line, a GNSS fix at every step.

    ``outages``: pairs (start, end); ``faulty``: triples (index of the fix, error north [m], bit).
    """
    time = np.arange(1.0, steps + 1.0)
    offset = np.zeros((steps, 3))
    offset[:, 1] = SPEED * time
    attitude = np.stack([0.1 * np.sin(time), 0.05 * np.cos(time), 0.01 * time], axis=1)
    truth = NavigationStates(time, displace(START, offset), np.tile([0.0, SPEED, 0.0], (steps, 1)), attitude)
    faults = np.zeros(steps, dtype=np.uint32)
    fault_error = np.zeros((steps, 3))
    for index, north, bit in faulty:
        faults[index] |= 1 << bit
        fault_error[index, 0] = north
    lost = np.zeros(steps, dtype=bool)
    for start, end in outages:
        lost |= (time >= start) & (time < end)
    gnss = AidStream(
        "gnss",
        "gnss_position",
        time[~lost],
        truth.position[~lost],
        faults[~lost],
        fault_error[~lost],
        np.ones((steps, 3))[~lost],
        time[lost],
    )
    labels = tuple(FaultLabel("outage", ("gnss",), start, end) for start, end in outages)
    return Recording(
        "tiny-v1",
        7,
        Instruments([Datasheet("gnss", "gnss_position", 1.0, np.array([2.0, 2.0, 4.0]))]),
        NavigationStates(np.zeros(1), START[None], np.array([[0.0, SPEED, 0.0]]), np.zeros((1, 3))),
        InitialState(0.0, START, np.array([0.0, SPEED, 0.0]), np.zeros(3), np.eye(9)),
        labels,
        Block(0.0, float(steps), None, None, {"gnss": gnss}, truth),
    )


def make_trial(recording: Recording, error: Any, **fields: Any) -> Trial:
    """A trial whose errors are the given ones, (T, 9) or (9,)."""
    truth = recording.data.truth
    error = np.broadcast_to(np.asarray(error, dtype=float), (len(truth) if np.ndim(error) == 1 else len(error), 9))
    truth = truth[: len(error)]
    dcm = dcm_from_rotation_vector(error[:, 6:]) @ dcm_from_rpy(truth.attitude)
    trial = Trial(
        estimator="given",
        status="ok",
        reason="",
        time=truth.time,
        position=displace(truth.position, error[:, :3]),
        velocity=truth.velocity + error[:, 3:6],
        attitude=rpy_from_dcm(dcm),
        estimated=np.ones(error.shape, dtype=bool),
        covariance=None,
        diagnostics={},
        flagged=[],
        update_seconds=np.full(len(truth), 1e-3),
    )
    return replace(trial, **fields)
