"""Do ideal samples of an IMU in a seaway integrate back to the truth, by the mechanization of another library?

A ship sails an hour in a quartering sea with the response ``encounter``: heave, roll, pitch and yaw at the encounter
frequency, zigzags and a current. Its ideal samples are integrated by python-ins. Promised: less than 5 cm from the
true position after an hour. An integration without a measurement of height is unstable in the vertical, so the height
is not integrated there. ``travelled`` gives the error at every minute; a test asserts its growth over four minutes.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
import pandas as pd
import pyins.strapdown

from simnav.geometry.earth import relative_position
from simnav.types import Array
from simnav.world import Current, Sea, Ship, Start, World, ZigZag

__all__ = ["PROMISED", "rows", "travelled"]

#: Largest error after an hour [m].
PROMISED = 0.05
_RATE = 200.0


def travelled(seconds: float) -> Array:
    """Horizontal distance between python-ins and the truth at every minute [m].

    Parameters
    ----------
    seconds : float
        Length of the voyage, a multiple of 60 s.
    """
    sea = Sea(significant_height=2.0, peak_period=8.0, direction=0.8, response="encounter")
    start = Start(latitude=np.radians(54.0), longitude=np.radians(8.0), heading=0.3, speed=6.0)
    manoeuvres = [ZigZag(angle=np.radians(20.0), duration=seconds)]
    world = World(start, Ship(), manoeuvres, sea, Current(speed=0.5, direction=1.0), rate=_RATE, seed=5)
    first = world.state()
    time = np.arange(60.0, seconds + 1.0, 60.0)
    block = world.advance(seconds, {"minutes": time})
    names = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    means = np.column_stack([block.imu.angular_rate, block.imu.specific_force]) / _RATE
    raw = pd.DataFrame(means, index=block.imu.time, columns=names)
    raw = pyins.strapdown.compute_increments_from_imu(pd.concat([raw.iloc[:1].set_axis([0.0]), raw]), "increment")
    place = first.position[0]
    values = [*np.degrees(place[:2]), place[2], *first.velocity[0], *np.degrees(first.attitude[0])]
    columns = ["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"]
    pva = pd.Series(values, index=columns, name=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pandas, about python-ins
        found = pyins.strapdown.Integrator(pva, False).integrate(raw)
    at = found.iloc[np.searchsorted(found.index.to_numpy(), time - 1e-6)]
    truth = block.taps["minutes"].position
    theirs = np.column_stack([np.radians(at.lat), np.radians(at.lon), truth[:, 2]])
    return np.asarray(np.hypot(*relative_position(theirs, truth)[:, :2].T))


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """See `tests.audit.__main__`."""
    away = travelled(3600.0)
    yield (
        "python-ins on ideal samples, 1 h in a seaway",
        f"{100.0 * away[-1]:.1f} cm, at most {100.0 * away.max():.1f} cm",
        f"below {100.0 * PROMISED:.0f} cm",
        bool(away.max() < PROMISED),
    )
