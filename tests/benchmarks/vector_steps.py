"""Steps a second of the environment and of learning tasks in their vector forms, beside Gymnasium's.

``python -m tests.benchmarks.vector_steps`` prints a table of medians. Those on one core step in turn, and their seconds
are of processor time, which other processes disturb least. On two cores they are of the clock: run it on a machine that
does nothing else. Voyages are prepared beforehand. With names of parts (``step``,
``environment``, ``tuning``, ``guidance``) it measures these only, and with ``--one-core`` nothing on two cores.
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from functools import partial

import numpy as np
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from simnav.environment import NavigationEnv, NavigationVectorEnv
from simnav.estimators.learning.environment import FilterTaskEnv
from simnav.estimators.learning.guidance import GuidanceEnv
from simnav.estimators.learning.guidance_vector import GuidanceVectorEnv
from simnav.estimators.learning.pool import Pool
from simnav.estimators.learning.vector import FilterTaskVectorEnv

N, STEPS, ROUNDS = 64, 150, 7
#: Steps of a voyage of `GUIDANCE`.
VOYAGE = 319
TUNING = ("training-gnss-faults", "Tuning")
GUIDANCE = "gnss-noise-step"


def tuning(n):
    return FilterTaskVectorEnv(*TUNING, n, steps=STEPS, instruments="fixes")


def one_tuning():
    return FilterTaskEnv(*TUNING, steps=STEPS, instruments="fixes")


def rate(envs, steps, clock=time.perf_counter, actions=None):
    """Steps a second of all environments together."""
    if actions is None:
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


def measure_step(two_cores):
    """A step of one environment: the least and the median of windows of 64 steps, in microseconds."""
    for name in (GUIDANCE, "open-sea"):
        for loop, closed in (("open loop", False), ("closed loop", True)):
            env, found = NavigationEnv(name, closed_loop=closed), []
            for seed in range(4):
                _, info = env.reset(seed=seed)
                start = info["start"]
                action = np.stack([start.position, start.velocity, start.attitude])
                for k in range(5):
                    begun = time.process_time()
                    for _ in range(56 if k == 0 else 64):  # the first are short stretches
                        env.step(action)
                    found += [(time.process_time() - begun) / 64] if k else []
            print(f"  {name} in {loop:12}{1e6 * min(found):8.1f} us, median{1e6 * np.median(found):8.1f} us")


def measure_environment(two_cores):
    """Whole voyages, without their resets, the fastest of three: a form may simulate many steps in one of them."""
    for loop, closed in (("open loop", False), ("closed loop", True)):
        single = partial(NavigationEnv, GUIDANCE, closed_loop=closed)
        simnav = NavigationVectorEnv(GUIDANCE, N, closed_loop=closed)
        forms, found = {"simnav": simnav, "SyncVectorEnv": SyncVectorEnv([single] * N)}, {}
        for seed in (1, 100, 200):
            for name, envs in forms.items():
                actions = starts(envs.reset(seed=seed)[1])
                steps = rate(envs, VOYAGE, time.process_time, actions)
                found[name] = max(steps, found.get(name, 0.0))
        show(f"Environment in {loop}", found)


def starts(infos):
    """The starts of voyages, as estimates."""
    return np.stack([np.stack([s.position, s.velocity, s.attitude]) for s in infos["start"]])


def measure_tuning(two_cores):
    forms = {"simnav": tuning(N), "SyncVectorEnv": SyncVectorEnv([one_tuning] * N)}
    found = in_turn(forms, {"simnav": 28, "SyncVectorEnv": 6})
    pool = forms["simnav"]._pool
    most = pool.capacity * Pool.cost(pool.options) / 1e6
    print(f"Tuning keeps {pool.capacity} prepared voyages of {STEPS} steps in at most {most:.0f} MB")
    if two_cores:
        found["simnav, two cores"] = on_two_cores(tuning, 28)
        parallel = AsyncVectorEnv([one_tuning] * N)
        found |= in_turn({"AsyncVectorEnv, two cores": parallel}, {"AsyncVectorEnv, two cores": 20}, time.perf_counter)
        parallel.close()
    show("Tuning", found)


def measure_guidance(two_cores):
    single = partial(GuidanceEnv, GUIDANCE)
    forms = {"simnav": GuidanceVectorEnv(GUIDANCE, N), "SyncVectorEnv": SyncVectorEnv([single] * N)}
    found = in_turn(forms, {"simnav": 30, "SyncVectorEnv": 30})
    if two_cores:
        found["simnav, two cores"] = on_two_cores(partial(GuidanceVectorEnv, GUIDANCE), 30)
    short = GuidanceVectorEnv(GUIDANCE, N, steps=29)  # each thirtieth step is a reset of all voyages
    found |= in_turn({"simnav, episodes of 29 steps": short}, {"simnav, episodes of 29 steps": 30})
    show("Guidance", found)


PARTS = {
    "step": measure_step,
    "environment": measure_environment,
    "tuning": measure_tuning,
    "guidance": measure_guidance,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; default: all")
    parser.add_argument("--one-core", action="store_true", help="measure nothing on two cores")
    given = parser.parse_args()
    for part in given.parts or PARTS:
        PARTS[part](not given.one_core)


def show(task, found):
    print(f"{task}, {N} environments")
    for name, steps in found.items():
        print(f"  {name:30}{steps:10.0f} steps/s{steps / found['SyncVectorEnv']:8.1f} times SyncVectorEnv")


if __name__ == "__main__":
    main()
