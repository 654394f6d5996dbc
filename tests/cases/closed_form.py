"""A small world of its own: a closed-form voyage, sampled independently of simnav's simulator."""

from __future__ import annotations

import numpy as np

from simnav import inverse_strapdown
from simnav.geometry import earth, rotation
from simnav.recording import AidStream, Block, Recording
from simnav.types import (
    KINDS,
    Datasheet,
    ImuDatasheet,
    ImuSamples,
    InitialState,
    Instruments,
    NavigationStates,
    TriadDatasheet,
)

DEG = np.pi / 180.0
G = 9.80665e-6  # one micro-g

IMU = ImuDatasheet(
    rate=50.0,
    gyroscope=TriadDatasheet(
        bias=1.0 * DEG / 3600, bias_instability=1.0 * DEG / 3600, correlation_time=300.0, random_walk=0.05 * DEG / 60
    ),
    accelerometer=TriadDatasheet(bias=100 * G, bias_instability=100 * G, correlation_time=300.0, random_walk=50 * G),
)
AIDS = (
    Datasheet("gnss", "gnss_position", 1.0, np.array([1.5, 1.5, 3.0]), lever_arm=np.array([2.0, -1.0, -8.0])),
    Datasheet("gnss_velocity", "gnss_velocity", 1.0, 0.1 * np.ones(3), lever_arm=np.array([2.0, -1.0, -8.0])),
    Datasheet("dvl", "dvl", 1.0, 0.02 * np.ones(3), phase=0.333, lever_arm=np.array([1.0, 0.5, 3.0])),
    Datasheet("compass", "magnetic_compass", 2.0, np.array([1.0 * DEG])),
    Datasheet("depth", "depth", 1.0, np.array([0.3]), lever_arm=np.array([0.0, 0.0, 2.0])),
)
#: One instrument of each kind, with biases, scale factors and lever arms, and a DVL without errors but its noise.
EVERY_KIND = (
    Datasheet("gnss", "gnss_position", 1.0, np.ones(3), bias=np.ones(3), lever_arm=np.array([2.0, -1.0, -8.0])),
    Datasheet("gnss_velocity", "gnss_velocity", 1.0, np.ones(3), lever_arm=np.array([2.0, -1.0, -8.0])),
    Datasheet(
        "dvl", "dvl", 1.0, np.ones(3), bias=np.full(3, 0.01), scale=0.01, misalignment=np.full(3, 0.01),
        lever_arm=np.array([1.0, 0.5, 3.0]),
    ),
    Datasheet("plain_dvl", "dvl", 1.0, np.ones(3), lever_arm=np.array([1.0, 0.5, 3.0])),
    Datasheet("magnetic", "magnetic_compass", 1.0, np.ones(1), bias=np.ones(1)),
    Datasheet("gyrocompass", "gyrocompass", 1.0, np.ones(1)),
    Datasheet("log", "speed_log", 1.0, np.ones(1), bias=np.ones(1), scale=0.01, lever_arm=np.array([1.0, 0.5, 3.0])),
    Datasheet("depth", "depth", 1.0, np.ones(1), lever_arm=np.array([1.0, 0.5, 3.0])),
    Datasheet("terrain", "terrain_fix", 1.0, np.ones(2), lever_arm=np.array([1.0, 0.5, 3.0])),
)  # fmt: skip
SIGMAS = np.array([2.0, 2.0, 3.0, 0.2, 0.2, 0.2, 0.1 * DEG, 0.1 * DEG, 1.0 * DEG])


def voyage(time: np.ndarray, turning: float = 1.0, sea: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and roll-pitch-yaw: weaving at 4 m/s in a swell."""
    yaw = 0.7 + turning * (0.6 * np.sin(time / 40.0) + 0.3 * np.sin(time / 17.0))
    roll = sea * 0.06 * np.sin(0.7 * time)
    pitch = sea * 0.03 * np.sin(0.9 * time + 1.0)
    speed = 4.0 + 0.5 * turning * np.sin(time / 60.0)
    velocity = np.stack([speed * np.cos(yaw), speed * np.sin(yaw), sea * 0.3 * np.sin(0.8 * time)], axis=1)
    return velocity, np.stack([roll, pitch, yaw], axis=1)


def gauss_markov(rng: np.random.Generator, time: np.ndarray, sigma: np.ndarray, tau: float) -> np.ndarray:
    """(n, d) samples of a stationary first-order Gauss-Markov process."""
    out = np.empty((len(time), len(sigma)))
    out[0] = sigma * rng.standard_normal(len(sigma))
    for k in range(1, len(time)):
        a = np.exp(-(time[k] - time[k - 1]) / tau)
        out[k] = a * out[k - 1] + sigma * np.sqrt(1 - a * a) * rng.standard_normal(len(sigma))
    return out


def triad(rng: np.random.Generator, t: np.ndarray, sheet: TriadDatasheet, rate: float) -> np.ndarray:
    """(n, 3) errors of a triad of sensors."""
    slow = t[::10]  # the bias moves slowly: a tenth of the samples will do
    error = sheet.bias * rng.standard_normal(3) + sheet.random_walk * np.sqrt(rate) * rng.standard_normal((len(t), 3))
    moving = gauss_markov(rng, slow, np.full(3, sheet.bias_instability), sheet.correlation_time)
    return error + np.stack([np.interp(t, slow, m) for m in moving.T], axis=1)


def make_recording(
    seed: int = 0,
    duration: float = 60.0,
    imu: ImuDatasheet | None = IMU,
    aids: tuple[Datasheet, ...] = AIDS,
    sigmas: np.ndarray = SIGMAS,
    step: float = 1.0,
    turning: float = 1.0,
    sea: float = 1.0,
) -> Recording:
    """A recording with errors exactly as the datasheets say (scale and misalignment drawn for the DVL)."""
    rng = np.random.default_rng([seed, 77])
    rate = 50.0
    t = np.arange(round(duration * rate) + 1) / rate
    velocity, rpy = voyage(t, turning, sea)
    ideal, position = inverse_strapdown.increments(t, np.array([0.9, 0.1, 0.0]), velocity, rpy)
    dcm = rotation.dcm_from_rpy(rpy)

    samples = None
    if imu is not None:
        samples = ImuSamples(
            ideal.time,
            ideal.interval,
            ideal.angular_rate + triad(rng, ideal.time, imu.gyroscope, rate),
            ideal.specific_force + triad(rng, ideal.time, imu.accelerometer, rate),
        )
    omega = np.concatenate([ideal.angular_rate[:1], 0.5 * (ideal.angular_rate[1:] + ideal.angular_rate[:-1]),
                            ideal.angular_rate[-1:]])  # fmt: skip
    omega = omega - np.einsum("nji,nj->ni", dcm, earth.earth_rate(position[:, 0]))

    streams = {}
    for sheet in aids:
        first = sheet.phase if sheet.phase > 0 else 1.0 / sheet.rate
        times = np.arange(first, duration + 1e-9, 1.0 / sheet.rate)
        lever = sheet.lever_arm
        at = np.stack([np.interp(times, t, p) for p in position.T], axis=1)
        c = rotation.dcm_from_rpy(np.stack([np.interp(times, t, a) for a in rpy.T], axis=1))
        v = np.stack([np.interp(times, t, p) for p in velocity.T], axis=1)
        w = np.stack([np.interp(times, t, p) for p in omega.T], axis=1)
        u = np.einsum("nji,nj->ni", c, v) + np.cross(w, lever)
        d = len(KINDS[sheet.kind].errors)
        error = sheet.sigma * rng.standard_normal((len(times), d)) + sheet.bias * rng.standard_normal(d)
        if np.any(sheet.bias_instability):
            error = error + gauss_markov(rng, times, sheet.bias_instability, sheet.correlation_time)
        ned = c @ lever
        if sheet.kind in ("gnss_position", "terrain_fix"):
            full = ned.copy()
            full[:, :d] += error
            value = earth.displace(at, full)[:, :d]
        elif sheet.kind == "gnss_velocity":
            value = np.einsum("nij,nj->ni", c, u) + error
        elif sheet.kind == "dvl":
            s, a = sheet.scale * rng.standard_normal(), sheet.misalignment * rng.standard_normal(3)
            value = (1 + s) * (u @ rotation.dcm_from_rotation_vector(a)) + error
        elif sheet.kind == "speed_log":
            value = (1 + sheet.scale * rng.standard_normal()) * u[:, :1] + error
        elif sheet.kind == "depth":
            value = ned[:, 2:] - at[:, 2:] + error
        else:
            value = rotation.wrap_angle(np.interp(times, t, rpy[:, 2])[:, None] + error)
        zeros = np.zeros((len(times), d))
        streams[sheet.name] = AidStream(
            sheet.name, sheet.kind, times, value, np.zeros(len(times), np.uint32), zeros,
            np.broadcast_to(sheet.sigma, (len(times), d)).copy(), np.empty(0),
        )  # fmt: skip

    e = sigmas * rng.standard_normal(9)
    start = InitialState(
        0.0,
        earth.displace(position[0], e[:3]),
        velocity[0] + e[3:6],
        rotation.rpy_from_dcm(rotation.dcm_from_rotation_vector(e[6:]) @ dcm[0]),
        np.diag(sigmas**2),
    )
    stride = round(step * rate)
    at_steps = slice(stride, None, stride)
    truth = NavigationStates(t[at_steps], position[at_steps], velocity[at_steps], rpy[at_steps])
    initial = NavigationStates(t[:1], position[:1], velocity[:1], rpy[:1])
    return Recording(
        "closed-form-v1", seed, Instruments(aids, imu, step), initial, start, (),
        Block(0.0, duration, samples, None, streams, truth),
    )  # fmt: skip


def run(estimator, recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Errors (T, 9) and covariances (T, 9, 9) of an estimator over a recording."""
    estimator.reset(recording.start, recording.instruments)
    errors, covariances = [], []
    for k, packet in enumerate(recording.steps()):
        out = estimator.update(packet)
        truth = recording.data.truth
        mask = out.mask()
        e = np.full(9, np.nan)
        if out.position is not None:
            e[:3] = earth.relative_position(out.position, truth.position[k])
        if out.velocity is not None:
            e[3:6] = out.velocity - truth.velocity[k]
        if out.attitude is not None:
            turn = rotation.dcm_from_rpy(out.attitude) @ rotation.dcm_from_rpy(truth.attitude[k]).T
            e[6:] = rotation.rotation_vector_from_dcm(turn)
        e[~mask] = np.nan
        errors.append(e)
        covariances.append(np.full((9, 9), np.nan) if out.covariance is None else out.covariance)
    return np.array(errors), np.array(covariances)
