"""Steps a second of learning tasks in their vector forms, beside Gymnasium's, on one core and on two.

``python -m tests.benchmarks.vector_steps`` prints a table of medians. Those on one core step in turn, and their seconds
are of processor time, which other processes disturb least. On two cores they are of the clock: run it on a machine that
does nothing else. Voyages are prepared beforehand.
"""

from __future__ import annotations

import multiprocessing
import time
from functools import partial

import numpy as np
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from simnav.estimators.learning.environment import FilterTaskEnv
from simnav.estimators.learning.guidance import GuidanceEnv
from simnav.estimators.learning.guidance_vector import GuidanceVectorEnv
from simnav.estimators.learning.vector import FilterTaskVectorEnv

N, STEPS, ROUNDS = 64, 150, 7
TUNING = ("training-gnss-faults", "Tuning")
GUIDANCE = "gnss-noise-step"


def tuning(n):
    return FilterTaskVectorEnv(*TUNING, n, steps=STEPS, instruments="fixes")


def one_tuning():
    return FilterTaskEnv(*TUNING, steps=STEPS, instruments="fixes")


def rate(envs, steps, clock=time.perf_counter):
    """Steps a second of all environments together."""
    actions = np.zeros(envs.action_space.shape, envs.action_space.dtype)
    begun = clock()
    for _ in range(steps):
        envs.step(actions)
    return steps * envs.num_envs / (clock() - begun)


def in_turn(all_envs, steps, clock=time.process_time):
    """The median rate of several vector forms that step in turn."""
    rates = {name: [] for name in all_envs}
    for envs in all_envs.values():
        envs.reset(seed=1)
    for _ in range(ROUNDS):
        for name, envs in all_envs.items():
            rates[name].append(rate(envs, steps[name], clock))
    return {name: float(np.median(found)) for name, found in rates.items()}


def half(barrier, make, n, steps, rates):
    """One of two processes: its rates, while the other does the same."""
    envs = make(n)
    envs.reset(seed=1)
    rate(envs, 10)
    for _ in range(ROUNDS):
        barrier.wait()
        rates.put(rate(envs, steps))


def on_two_cores(make, steps):
    """The median rate of two processes together, each with half of the environments."""
    context = multiprocessing.get_context("fork")
    barrier, rates = context.Barrier(2), context.Queue()
    processes = [context.Process(target=half, args=(barrier, make, N // 2, steps, rates)) for _ in range(2)]
    for process in processes:
        process.start()
    found = [rates.get(timeout=200) for _ in range(2 * ROUNDS)]
    for process in processes:
        process.join()
    return 2.0 * float(np.median(found))


def main():
    single = partial(GuidanceEnv, GUIDANCE)
    forms = {"simnav": tuning(N), "SyncVectorEnv": SyncVectorEnv([one_tuning] * N)}
    found = in_turn(forms, {"simnav": 28, "SyncVectorEnv": 6})
    found["simnav, two cores"] = on_two_cores(tuning, 28)
    parallel = AsyncVectorEnv([one_tuning] * N)
    found |= in_turn({"AsyncVectorEnv, two cores": parallel}, {"AsyncVectorEnv, two cores": 20}, time.perf_counter)
    parallel.close()
    show("Tuning", found)
    forms = {"simnav": GuidanceVectorEnv(GUIDANCE, N), "SyncVectorEnv": SyncVectorEnv([single] * N)}
    found = in_turn(forms, {"simnav": 30, "SyncVectorEnv": 30})
    found["simnav, two cores"] = on_two_cores(partial(GuidanceVectorEnv, GUIDANCE), 30)
    show("Guidance", found)


def show(task, found):
    print(f"{task}, {N} environments")
    for name, steps in found.items():
        print(f"  {name:28}{steps:10.0f} steps/s{steps / found['SyncVectorEnv']:8.1f} times SyncVectorEnv")


if __name__ == "__main__":
    main()
