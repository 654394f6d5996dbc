"""Trials: every status, what is kept of a failed one, and that the recording comes out untouched."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from simnav.estimator import Estimator, UnsuitableScenario
from simnav.geometry.earth import displace
from simnav.recording import AidStream, Block, Recording
from simnav.trial import DIVERGENCE_LIMIT, run_trial
from simnav.types import (
    Datasheet,
    Estimate,
    ImuDatasheet,
    ImuSamples,
    InitialState,
    Instruments,
    NavigationStates,
    TriadDatasheet,
)

STEPS = 12
START = np.array([np.radians(50.0), np.radians(-5.0), 0.0])


@pytest.fixture
def recording() -> Recording:
    """Twelve one-second steps north at 2 m/s, with an IMU at 4 Hz and GNSS at 1 Hz."""
    time = np.arange(1.0, STEPS + 1.0)
    north = np.zeros((STEPS, 3))
    north[:, 0] = 2.0 * time
    truth = NavigationStates(time, displace(START, north), np.tile([2.0, 0.0, 0.0], (STEPS, 1)), np.zeros((STEPS, 3)))
    n = 4 * STEPS
    imu = ImuSamples(
        0.25 * np.arange(1.0, n + 1), np.full(n, 0.25), np.zeros((n, 3)), np.tile([0.0, 0.0, -9.81], (n, 1))
    )
    gnss = AidStream(
        "gnss",
        "gnss_position",
        time,
        truth.position.copy(),
        np.zeros(STEPS, dtype=np.uint32),
        np.zeros((STEPS, 3)),
        np.ones((STEPS, 3)),
        np.zeros(0),
    )
    instruments = Instruments(
        [Datasheet("gnss", "gnss_position", 1.0, np.ones(3))],
        ImuDatasheet(4.0, TriadDatasheet(), TriadDatasheet()),
        1.0,
    )
    zero = np.zeros(1)
    return Recording(
        "tiny-v1",
        7,
        instruments,
        NavigationStates(zero, START[None], np.array([[2.0, 0.0, 0.0]]), np.zeros((1, 3))),
        InitialState(0.0, START.copy(), np.array([2.0, 0.0, 0.0]), np.zeros(3), np.eye(9)),
        (),
        Block(0.0, float(STEPS), imu, None, {"gnss": gnss}, truth),
    )


class Good(Estimator):
    """The last fix; from step ``fail_at`` on (0 is the first), what ``wrong`` makes of the estimate."""

    fail_at = 5

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        self.k = -1
        self.buffer = np.zeros(3)

    def update(self, measurements: Any) -> Any:
        self.k += 1
        self.buffer[:] = measurements.latest("gnss").value
        estimate = Estimate(
            measurements.time,
            self.buffer,
            np.array([2.0, 0.0, 0.0]),
            np.zeros(3),
            np.eye(9),
            diagnostics={"weight": 0.5 * self.k},
            flagged=[("gnss", measurements.time)] if self.k == 2 else (),
        )
        return self.wrong(estimate) if self.k >= self.fail_at else estimate

    def wrong(self, estimate: Estimate) -> Any:
        return estimate


def failing(change: Any) -> Good:
    """A `Good` whose estimate goes through ``change`` from the sixth step on."""
    estimator = Good()
    estimator.wrong = change  # type: ignore[method-assign]
    return estimator


def with_(**fields: Any) -> Any:
    def change(estimate: Estimate) -> Estimate:
        for name, value in fields.items():
            setattr(estimate, name, value)
        return estimate

    return change


def indefinite(size: float = 1.0) -> np.ndarray:
    p = np.eye(9)
    p[0, 1] = p[1, 0] = 1.0 + size
    return p


def asymmetric() -> np.ndarray:
    p = np.eye(9)
    p[3, 4] = 0.1
    return p


def test_a_good_estimator_is_ok_and_all_of_it_is_kept(recording: Recording) -> None:
    trial = run_trial(Good(), recording)
    assert (trial.status, trial.reason, trial.failed) == ("ok", "", False)
    assert trial.estimator == "Good"
    np.testing.assert_array_equal(trial.time, recording.data.truth.time)
    np.testing.assert_array_equal(trial.position, recording.data.truth.position)  # though it reuses its buffer
    assert trial.estimated.all()
    assert trial.covariance is not None
    np.testing.assert_array_equal(trial.covariance, np.broadcast_to(np.eye(9), (STEPS, 9, 9)))
    np.testing.assert_array_equal(trial.diagnostics["weight"], 0.5 * np.arange(STEPS))
    assert trial.flagged == [("gnss", 3.0)]
    assert (trial.update_seconds > 0.0).all()
    assert trial.smoothed is None


def test_covariance_can_be_left_out_and_is_checked_all_the_same(recording: Recording) -> None:
    assert run_trial(Good(), recording, keep_covariance=False).covariance is None
    bad = run_trial(failing(with_(covariance=indefinite())), recording, keep_covariance=False)
    assert (bad.status, len(bad)) == ("invalid-output", 5)


def test_only_what_is_estimated_has_to_be_finite(recording: Recording) -> None:
    heading_only = np.array([1, 1, 0, 1, 1, 0, 0, 0, 1], dtype=bool)
    covariance = np.where(np.outer(heading_only, heading_only), np.eye(9), np.nan)

    def ship(estimate: Estimate) -> Estimate:
        position = np.append(estimate.position[:2], np.nan)
        return Estimate(
            estimate.time,
            position,
            np.array([2.0, 0.0, np.nan]),
            np.array([np.nan, np.nan, 0.1]),
            covariance,
            estimated=heading_only,
        )

    trial = run_trial(failing(ship), recording)
    assert trial.status == "ok"
    np.testing.assert_array_equal(trial.estimated[-1], heading_only)
    assert np.isnan(trial.position[-1, 2])
    assert trial.covariance is not None
    assert trial.covariance[-1, 8, 8] == 1.0


def test_estimates_may_leave_out_whole_vectors(recording: Recording) -> None:
    trial = run_trial(failing(lambda e: Estimate(e.time, velocity=e.velocity)), recording)
    assert trial.status == "ok"
    assert np.isnan(trial.position[5:]).all()
    assert not np.isnan(trial.position[:5]).any()
    assert trial.covariance is not None
    assert np.isnan(trial.covariance[5:]).all()
    assert trial.estimated[-1].tolist() == [False] * 3 + [True] * 3 + [False] * 3


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda e: None, "expected an Estimate, got NoneType"),
        (lambda e: e.position, "expected an Estimate, got ndarray"),
        (with_(time=99.0), "time of the estimate is 99.0, the step ends at 6.0"),
        (with_(time=np.nan), "time of the estimate is nan"),
        (with_(time="now"), "time is not a number: 'now'"),
        (with_(position=np.zeros(2)), r"position has shape \(2,\), expected \(3,\)"),
        (with_(position="here"), "position is not an array of real numbers"),
        (with_(position=np.array([np.nan, 0.0, 0.0])), "position is not finite"),
        (with_(velocity=np.array([np.inf, 0.0, 0.0])), "velocity is not finite"),
        (with_(attitude=np.array([0.0, 0.0, np.nan])), "attitude is not finite"),
        (with_(estimated=np.ones(3, dtype=bool)), r"estimated has shape \(3,\), expected \(9,\)"),
        (with_(covariance=np.eye(15)), r"covariance has shape \(15, 15\), expected \(9, 9\)"),
        (with_(covariance=np.full((9, 9), np.nan)), "at 6 s the covariance is not finite"),
        (with_(covariance=np.diag([1.0, -2.0] + [1.0] * 7)), "the covariance has a negative variance of east: -2"),
        (with_(covariance=indefinite()), "at 6 s the covariance is not positive semi-definite"),
        (with_(covariance=asymmetric()), "at 6 s the covariance is not symmetric"),
        (with_(diagnostics={"weight": "big"}), "diagnostic 'weight' is not an array of real numbers"),
        (with_(diagnostics={"weight": np.zeros(2)}), "diagnostic 'weight' changes its number of dimensions"),
        (with_(diagnostics=None), "diagnostics is a dict, not NoneType"),
        (with_(states=[1.0]), "states is a dict, not list"),
        (with_(states={"clock": 1.0}), r"states\['clock'\] is a pair, value and sigma, not 1.0"),
        (with_(states={"clock": ("late", 1.0)}), r"diagnostic 'state.clock' is not an array of real numbers"),
        (with_(flagged=None), "flagged is a list, not NoneType"),
        (with_(position=np.zeros(3, dtype=complex)), "position is not an array of real numbers"),
        (with_(covariance=np.eye(9) + 0j), "covariance is not an array of real numbers"),
        (with_(flagged=["gnss"]), r"flagged holds pairs \(instrument, time\), not 'gnss'"),
        (with_(flagged=[(3.0, "gnss")]), "flagged holds pairs"),
    ],
)
def test_invalid_output_is_named_and_what_came_before_is_kept(recording: Recording, change: Any, said: str) -> None:
    trial = run_trial(failing(change), recording)
    assert trial.status == "invalid-output"
    assert trial.failed
    with pytest.raises(ValueError, match=said):
        raise ValueError(trial.reason)
    assert len(trial) == 5
    np.testing.assert_array_equal(trial.position, recording.data.truth.position[:5])
    assert trial.covariance is not None
    assert len(trial.covariance) == 5
    assert len(trial.diagnostics["weight"]) == 5
    assert trial.flagged == [("gnss", 3.0)]


def test_rounding_in_a_covariance_is_forgiven(recording: Recording) -> None:
    p = np.diag([1e-20, 1e-20, 1e6, 0.0, 1.0, 1.0, 1e-10, 1e-10, 1e-10])
    p[0, 1] = p[1, 0] = 1e-20 * (1.0 + 1e-12)  # eigenvalue -1e-32
    p[4, 5] = 1e-12
    assert run_trial(failing(with_(covariance=p)), recording).status == "ok"
    p[0, 1] = p[1, 0] = 1.01e-20  # small, but no rounding
    assert run_trial(failing(with_(covariance=p)), recording).status == "invalid-output"


def test_an_exception_is_recorded_with_its_place(recording: Recording) -> None:
    def divide(estimate: Estimate) -> Estimate:
        return 1 / 0  # type: ignore[return-value]

    trial = run_trial(failing(divide), recording)
    assert trial.status == "error"
    assert len(trial) == 5
    line = divide.__code__.co_firstlineno + 1
    assert trial.reason == f"update() at 6 s: ZeroDivisionError: division by zero (test_session.py:{line} in divide)"


@pytest.mark.parametrize("error", [MemoryError("too much"), SystemExit(3), RecursionError("deep")])
def test_no_exception_of_an_estimator_escapes(recording: Recording, error: BaseException) -> None:
    def fail(estimate: Estimate) -> Estimate:
        raise error

    trial = run_trial(failing(fail), recording)
    assert trial.status == ("out-of-memory" if isinstance(error, MemoryError) else "error")
    assert type(error).__name__ in trial.reason
    assert len(trial) == 5


def test_the_keyboard_interrupts(recording: Recording) -> None:
    def interrupt(estimate: Estimate) -> Estimate:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_trial(failing(interrupt), recording)


def test_needs_that_are_not_met_are_no_failure(recording: Recording) -> None:
    class NeedsDvl(Good):
        needs = ("imu", ("dvl", "terrain_fix"))

    trial = run_trial(NeedsDvl(), recording)
    reason = "it needs dvl or terrain_fix; there is none"
    assert (trial.status, trial.reason, trial.failed, len(trial)) == ("unsuitable", reason, False, 0)


def test_who_uses_no_position_where_there_is_one_is_not_run(recording: Recording) -> None:
    class Reckons(Good):
        def observes(self, instruments: Instruments) -> set[str]:
            return instruments.keys() - {"gnss"}

    trial = run_trial(Reckons(), recording)
    reason = "it uses no instrument that gives a position; here that is gnss (gnss_position)"
    assert (trial.status, trial.reason, trial.failed, len(trial)) == ("unsuitable", reason, False, 0)


def test_to_refuse_a_scenario_that_has_what_is_needed_is_a_failure(recording: Recording) -> None:
    class Refuses(Good):
        needs = ("imu",)

        def reset(self, start: InitialState, instruments: Instruments) -> None:
            raise UnsuitableScenario("too hard")

    trial = run_trial(Refuses(), recording)
    reason = "reset(): it refuses a scenario that has all instruments that its needs name (too hard)"
    assert (trial.status, trial.reason, trial.failed) == ("error", reason, True)


@pytest.mark.parametrize(
    ("needs", "message"),
    [
        ("imu", "needs should be a tuple of names"),
        (("imu", 3), "one entry is 3"),
        (("imu", ()), "one entry is ()"),
        (("gnss_positon",), "needs names 'gnss_positon', no kind of instrument; did you mean 'gnss_position'?"),
    ],
)
def test_needs_that_make_no_sense_are_named(recording: Recording, needs: Any, message: str) -> None:
    trial = run_trial(type("Odd", (Good,), {"needs": needs})(), recording)
    assert trial.status == "error"
    assert message in trial.reason


def test_unsuitable_in_update_comes_too_late(recording: Recording) -> None:
    def late(estimate: Estimate) -> Estimate:
        raise UnsuitableScenario("too late")

    assert run_trial(failing(late), recording).status == "error"


@pytest.mark.parametrize(("factor", "status"), [(0.9, "ok"), (1.1, "diverged")])
def test_divergence_starts_at_its_limit(recording: Recording, factor: float, status: str) -> None:
    def away(estimate: Estimate) -> Estimate:
        position = displace(estimate.position, np.array([0.0, factor * DIVERGENCE_LIMIT, 0.0]))
        return with_(position=position)(estimate)  # type: ignore[no-any-return]

    trial = run_trial(failing(away), recording)
    assert trial.status == status
    if status == "diverged":
        assert len(trial) == 5
        assert "110 km is above the limit of 100 km" in trial.reason


def test_a_longitude_beyond_the_date_line_is_no_divergence(recording: Recording) -> None:
    def wrapped(estimate: Estimate) -> Estimate:
        return with_(position=estimate.position + np.array([0.0, 2 * np.pi, 0.0]))(estimate)  # type: ignore

    assert run_trial(failing(wrapped), recording).status == "ok"


def test_the_recording_survives_an_estimator_that_writes_into_its_input(recording: Recording) -> None:
    class Vandal(Good):
        def reset(self, start: InitialState, instruments: Instruments) -> None:
            super().reset(start, instruments)
            start.position[:] = 0.0
            start.covariance[:] = 0.0
            instruments["gnss"].sigma[:] = 0.0

        def update(self, measurements: Any) -> Any:
            estimate = super().update(measurements)
            measurements.imu.angular_rate[:] = 1e9
            measurements.imu.time[:] = 1e9
            measurements.aids[0].value[:] = 0.0
            measurements.aids.clear()
            return estimate

    assert run_trial(Vandal(), recording).status == "ok"
    assert not recording.data.imu.angular_rate.any()
    assert recording.data.imu.time[-1] == STEPS
    np.testing.assert_array_equal(recording.data.aids["gnss"].value, recording.data.truth.position)
    np.testing.assert_array_equal(recording.start.position, START)
    np.testing.assert_array_equal(recording.start.covariance, np.eye(9))
    assert recording.instruments["gnss"].sigma.tolist() == [1.0, 1.0, 1.0]


def test_the_imu_arrays_suit_the_kernels(recording: Recording) -> None:
    class Looks(Good):
        def update(self, measurements: Any) -> Any:
            for array in (measurements.imu.angular_rate, measurements.imu.specific_force, measurements.imu.interval):
                assert array.flags.c_contiguous
                assert array.flags.writeable
            assert len(measurements.imu) == 4
            return super().update(measurements)

    assert run_trial(Looks(), recording).status == "ok"


def test_only_a_reference_is_told_the_truth(recording: Recording) -> None:
    calls: list[str] = []

    class Told(Good):
        def reveal(self, recording: Recording) -> None:
            calls.append(recording.scenario)

        def reset(self, start: InitialState, instruments: Instruments) -> None:
            calls.append("reset")
            super().reset(start, instruments)

    class Oracle(Told):
        reference = True

    run_trial(Told(), recording)
    run_trial(Oracle(), recording)
    assert calls == ["reset", "tiny-v1", "reset"]


def test_diagnostics_that_come_and_go_or_change_length_are_padded(recording: Recording) -> None:
    def varying(estimate: Estimate) -> Estimate:
        k = round(estimate.time)
        return with_(diagnostics={"residual": np.arange(k % 3, dtype=float)} if k % 2 else {})(estimate)  # type: ignore

    trial = run_trial(failing(varying), recording)
    assert trial.status == "ok"
    residual = trial.diagnostics["residual"]
    np.testing.assert_array_equal(residual[6], [0.0, np.nan])  # 7 s: one value
    np.testing.assert_array_equal(residual[8], [np.nan, np.nan])  # 9 s: none
    np.testing.assert_array_equal(residual[10], [0.0, 1.0])
    assert np.isnan(trial.diagnostics["weight"][-1])


class Smoother(Good):
    def update(self, measurements: Any) -> Any:
        estimate = super().update(measurements)
        if self.k == 0:
            self.states: list[list[Any]] = []
        self.states.append([estimate.time, estimate.position.copy(), estimate.velocity, estimate.attitude])
        return estimate

    def smooth(self) -> Any:
        return NavigationStates(*(np.array(column) for column in zip(*self.states, strict=True)))


def test_a_smoothed_trajectory_is_kept(recording: Recording) -> None:
    trial = run_trial(Smoother(), recording)
    assert trial.status == "ok"
    assert trial.smoothed is not None
    np.testing.assert_array_equal(trial.smoothed.position, recording.data.truth.position)


@pytest.mark.parametrize(
    ("result", "said"),
    [
        (lambda s: s[:-1], r"time has shape \(11,\), expected \(12,\)"),
        (lambda s: s.position, "expected NavigationStates or None, got ndarray"),
        (lambda s: NavigationStates(s.time + 1.0, s.position, s.velocity, s.attitude), "times are not the ends"),
        (lambda s: NavigationStates(s.time, s.position * np.nan, s.velocity, s.attitude), "position is not finite"),
    ],
)
def test_a_wrong_smoothed_trajectory_fails_but_the_estimates_stand(
    recording: Recording, result: Any, said: str
) -> None:
    class Wrong(Smoother):
        def smooth(self) -> Any:
            return result(super().smooth())

    trial = run_trial(Wrong(), recording)
    assert trial.status == "invalid-output"
    assert trial.smoothed is None
    assert len(trial) == STEPS
    with pytest.raises(ValueError, match=said):
        raise ValueError(trial.reason)


def test_an_earlier_bad_covariance_outranks_a_later_exception(recording: Recording) -> None:
    def both(estimate: Estimate) -> Estimate:
        if estimate.time > 8.0:
            raise RuntimeError("later")
        return with_(covariance=indefinite())(estimate)  # type: ignore[no-any-return]

    trial = run_trial(failing(both), recording)
    assert trial.status == "invalid-output"
    assert len(trial) == 5


def test_many_epochs_are_checked_in_chunks(recording: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simnav.trial.log._CHUNK", 4)  # so that few epochs are several chunks; no user sets it
    trial = run_trial(failing(with_(covariance=2.0 * np.eye(9))), recording)
    assert trial.status == "ok"
    assert trial.covariance is not None
    assert trial.covariance[:, 0, 0].tolist() == [1.0] * 5 + [2.0] * 7
    trial = run_trial(failing(with_(covariance=indefinite())), recording)
    assert len(trial) == 5
    assert trial.flagged == [("gnss", 3.0)]
