"""A score of a third party: how often the horizontal error is above ten metres."""

import numpy as np

from simnav import register_score


@register_score("share_above_10_m", title="Share of epochs with an error above 10 m", unit="-", better="lower")
def share_above_10_m(scored):
    known = scored.horizontal[np.isfinite(scored.horizontal)]
    return np.mean(known > 10.0) if len(known) else float("nan")
