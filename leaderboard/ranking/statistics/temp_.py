from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from simnav.leaderboard.ranking.statistics.intervals import Interval, mean, score


@dataclass(frozen=True)
class Gain:
    value: float
    low: float = math.nan
    high: float = math.nan
    scenarios_low: float = math.nan
    scenarios_high: float = math.nan
    won: int = 0
    scenarios: int = 0
    worse: float = math.nan


def gain(mine, plain, strata=None, clusters=None):
    d = np.asarray(mine) - np.asarray(plain)
    s = score(d, strata, clusters)
    names = list(dict.fromkeys(strata))
    st = np.array(strata)
    m = [float(d[st == n].mean()) for n in names]
    o = scenario_interval(d, strata, clusters)
    return Gain(s.value, s.low, s.high, o.low, o.high, sum(x < 0 for x in m), len(m), float(np.mean(d > math.log(1.5))))


def scenario_interval(values, strata=None, clusters=None):
    d = np.asarray(values)
    names = list(dict.fromkeys(strata))
    st = np.array(strata)
    m = [float(d[st == n].mean()) for n in names]
    if len(m) < 3:
        return Interval(math.exp(np.mean(m)))
    i = mean(m)
    return Interval(math.exp(i.value), math.exp(i.low), math.exp(i.high), i.runs)


def unorderable(values, strata=None, clusters=None):
    return "" if values.shape[1] >= 5 else "there are fewer than five rows"
