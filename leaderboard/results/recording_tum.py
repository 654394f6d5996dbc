"""The true trajectory of a recording as TUM, for ``evo`` and others: time, position, quaternion.

Positions are east, north, up of the start that estimators get [m]; the quaternion (x, y, z, w) turns forward-left-up
axes to these axes. So it is what ``simnav score`` reads.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simnav.geometry.local import local_of_geodetic, turn_to_origin
from simnav.geometry.rotation import dcm_from_rpy, quaternion_from_dcm

from .files import write_whole
from .formats import writes
from .hidden import has_truth

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["write_tum"]

_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FLIP = np.diag([1.0, -1.0, -1.0])


@writes("recording", "tum")
def write_tum(recording: Recording, path: Path) -> list[Path]:
    """One line for each epoch whose truth is known.

    Raises
    ------
    ValueError
        If the recording has no truth.
    """
    if not has_truth(recording):
        raise ValueError("a TUM file holds the true trajectory, and the recording has none: write it with --truth")
    truth, origin = recording.data.truth, recording.start.position
    known = np.isfinite(truth.position).all(axis=1)
    position = local_of_geodetic(truth.position[known], origin) @ _ENU
    level = dcm_from_rpy(np.nan_to_num(truth.attitude[known]))
    quaternion = quaternion_from_dcm(_ENU @ turn_to_origin(truth.position[known], origin) @ level @ _FLIP)
    text = io.StringIO()
    np.savetxt(text, np.hstack([truth.time[known, None], position, quaternion[:, [1, 2, 3, 0]]]), fmt="%.17g")
    return [write_whole(path, text.getvalue())]
