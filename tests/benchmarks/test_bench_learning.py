"""Learning tasks: steps a second of the tuning task and of guidance in their vector forms,
beside Gymnasium's, and single steps in closed loop.

``pytest tests/benchmarks/test_bench_learning.py --benchmark-enable -s``. The three vector forms step the same voyages
in turn, so that the ratios hold on a machine that is busy. All is in one process on one core, but for
``AsyncVectorEnv``, which has a process for each of its four environments. The vector form is measured on voyages that
are prepared; what the preparation of a voyage costs is told beside it. Targets: 20 times ``SyncVectorEnv``; 50 000
steps a second.
"""

from __future__ import annotations

import time

import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from simnav.environment import NavigationEnv
from simnav.estimators.learning.environment import FilterTaskEnv
from simnav.estimators.learning.guidance import GuidanceEnv
from simnav.estimators.learning.guidance_vector import GuidanceVectorEnv
from simnav.estimators.learning.vector import FilterTaskVectorEnv

NAME, N, STEPS = "training-gnss-faults", 64, 200


@pytest.fixture(scope="module")
def bank():
    envs = FilterTaskVectorEnv(NAME, "Tuning", N, steps=STEPS, instruments="fixes")
    begun = time.perf_counter()
    envs.reset(seed=1)
    print(f"\npreparation of a voyage of {STEPS} steps: {(time.perf_counter() - begun) / N:.3f} s")
    return envs


def rate(envs, steps):
    """Steps a second of all environments together."""
    actions = np.zeros(envs.action_space.shape, np.float32)
    begun = time.perf_counter()
    for _ in range(steps):
        envs.step(actions)
    return steps * envs.num_envs / (time.perf_counter() - begun)


def single():
    return FilterTaskEnv(NAME, steps=STEPS, instruments="fixes")


def test_vector_forms_side_by_side(bank, benchmark):
    n = N if benchmark.enabled else 16  # each has a voyage to prepare, and its steps a second hardly depend on n
    others = {"SyncVectorEnv": SyncVectorEnv([single] * n), "AsyncVectorEnv": AsyncVectorEnv([single] * 4)}
    for envs in others.values():
        envs.reset(seed=1)
    rates = {name: [] for name in ("bank", *others)}
    for _ in range(5):  # in turn
        rates["bank"].append(rate(bank, 36))
        for name, envs in others.items():
            rates[name].append(rate(envs, 6))
    median = {name: float(np.median(values)) for name, values in rates.items()}
    print("\nsteps a second:", {name: round(value) for name, value in median.items()})
    print(f"the bank over SyncVectorEnv: {median['bank'] / median['SyncVectorEnv']:.1f}")
    for envs in others.values():
        envs.close()
    bank.reset(seed=1)
    actions = np.zeros(bank.action_space.shape, np.float32)
    benchmark.pedantic(bank.step, (actions,), rounds=5, iterations=30, warmup_rounds=1)
    assert median["bank"] > 10.0 * median["SyncVectorEnv"]


def test_vector_forms_of_guidance_side_by_side(benchmark):
    """Nothing is prepared here: each step is one of the world, the instruments, the filter and the scores."""
    n = 16
    forms = {
        "bank": GuidanceVectorEnv("gnss-noise-step", n),
        "SyncVectorEnv": SyncVectorEnv([lambda: GuidanceEnv("gnss-noise-step")] * n),
    }
    rates = {name: [] for name in forms}
    for envs in forms.values():
        envs.reset(seed=1)
        rate(envs, 4)
    for _ in range(5):  # in turn
        for name, envs in forms.items():
            rates[name].append(rate(envs, 20))
    median = {name: float(np.median(values)) for name, values in rates.items()}
    print("\nsteps of guidance a second:", {name: round(value) for name, value in median.items()})
    bank = forms["bank"]
    bank.reset(seed=1)
    actions = np.zeros(bank.action_space.shape, np.float32)
    benchmark.pedantic(bank.step, (actions,), rounds=5, iterations=30, warmup_rounds=1)
    if benchmark.enabled:  # a busy machine must not fail the tests
        assert median["bank"] > 0.8 * median["SyncVectorEnv"]  # 1.2 to 2.2 times


def test_a_step_of_guidance(benchmark):
    env = GuidanceEnv("gnss-noise-step")
    env.reset(seed=1)
    action = np.zeros(2, np.float32)
    observation, *_ = benchmark.pedantic(env.step, (action,), rounds=5, iterations=40, warmup_rounds=1)
    assert observation.shape == (16,)


def test_a_step_in_closed_loop(benchmark):
    env = NavigationEnv("gnss-noise-step", closed_loop=True)
    _, info = env.reset(seed=1)
    start = info["start"]
    action = np.stack([start.position, start.velocity, start.attitude])
    observation, *_ = benchmark.pedantic(env.step, (action,), rounds=5, iterations=40, warmup_rounds=1)
    assert observation["imu"]["valid"].sum() == 100


def test_a_frame(benchmark):
    """At least ten a second, with the step before it."""
    env = FilterTaskEnv(NAME, instruments="fixes", render_mode="rgb_array")
    env.reset(seed=1)
    action = np.zeros(2, np.float32)
    for _ in range(60):
        env.step(action)

    def shown():
        env.step(action)
        return env.render()

    assert benchmark.pedantic(shown, rounds=10, warmup_rounds=1).shape == (720, 720, 3)
