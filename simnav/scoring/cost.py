"""Cost: wall time of an update."""

from __future__ import annotations

import numpy as np

from simnav.trial import Trial

__all__ = ["cost"]


def cost(trial: Trial) -> dict[str, float]:
    """Time per epoch of a run.

    Returns
    -------
    dict
        ``update_median``, ``update_mean``, ``update_p95`` [s]. The first update is left out where there are others: it
        may load compiled code.
    """
    seconds = trial.update_seconds[1:] if len(trial) > 1 else trial.update_seconds
    if len(seconds) == 0:
        return dict.fromkeys(("update_median", "update_mean", "update_p95"), float("nan"))
    return {
        "update_median": float(np.median(seconds)),
        "update_mean": float(np.mean(seconds)),
        "update_p95": float(np.quantile(seconds, 0.95)),
    }
