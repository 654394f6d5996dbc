"""Does an error model that was fitted on one half of a log hold on the other half, with and without its fixes?

    SIMNAV_DATA=... python -m tests.identification.recordings
    python -m tests.identification.recordings --simulated 6
    python -m tests.identification.recordings --simulated 50 --seed 100 --exact --together 10

For every recorded scenario whose files are there: each recording is split in halves, `simnav log identify` fits the
datasheets on the first half, and the plain row (`ekf`, `ship-ekf` without an IMU) runs over the whole, with today's
datasheets and with the fitted ones. The second half is compared with the reference, without an outage, and within
outages of all position fixes, which simnav's fault layer lays over the log. The scenario's own faults are left out.
With ``--simulated`` the logs are voyages of `tests.identification.vessels`, whose datasheets are wrong. With
``--exact`` the datasheets that the errors of a voyage were drawn from take the place of the fit: no fit can be expected
to do better. A fit compares positions with the reference of a recording; with ``--reference`` it does so of simulated
logs, too. The last table says on which share of the logs the figures are in the ranges that are asked for.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from simnav.estimator import make
from simnav.geometry.earth import relative_position
from simnav.leaderboard.identification.report import identify
from simnav.log.channel import list_recordings
from simnav.log.table import LogError
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.sensors.faults import Outage, build_layers
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Array

from .vessels import VESSELS, exact, voyage

__all__ = ["Log", "main", "with_outage"]

#: Recorded scenarios; those of the folder are no part of the catalogue.
_CATALOGUE = ("auv-akit", "car-kitti", "car-road", "ship-nbp1406")
_FOLDER = Path(__file__).parents[2] / "scenarios" / "recordings"
#: Length of an outage, and from the beginning of one to that of the next [s].
_OUTAGE, _EVERY = 60.0, 100.0
#: The outages begin at so many places of that interval, each in a run of its own.
_PLACES = 2
#: What is asked of a log: the NEES over its expectation, the share within the 95 % region in outages, and the RMSE over
#: today's, with and without outages.
_NEES, _REGION, _RMSE = (0.7, 1.8), (0.85, 0.99), 1.3
_ASKED = ("NEES", "in outages: NEES", "within 95 %", "RMSE", "all")


@dataclass(frozen=True, eq=False)
class Log:
    """A log to be fitted: its scenario, what makes its recording with other datasheets, and the right ones if known."""

    name: str
    scenario: Scenario
    recording: Callable[[Scenario], Recording]
    exact: Scenario | None = None


@dataclass(frozen=True, eq=False)
class Errors:
    """Horizontal errors of position in the second half [m], with their covariances; within the outages or anywhere."""

    error: Array
    nees: Array

    @property
    def figures(self) -> tuple[float, float, float]:
        """RMSE [m], NEES over its expectation, share within the 95 % region."""
        rmse = float(np.sqrt(np.mean(np.sum(self.error**2, axis=1))))
        return rmse, float(self.nees.mean()) / 2.0, float(np.mean(self.nees < chi2.ppf(0.95, 2)))


def with_outage(recording: Recording, intervals: list[tuple[float, float]]) -> Recording:
    """The recording without fixes in some intervals [s]."""
    names = [n for n, s in recording.instruments.items() if s.role == "fix"]
    if not names:
        return recording
    fault = Outage(instruments=tuple(names), intervals=tuple(intervals))
    aids = dict(recording.data.aids)
    for layer in build_layers([fault], recording.seed):
        aids = {n: layer.laid_over(s) for n, s in aids.items()}
    return replace(recording, data=replace(recording.data, aids=aids))


def _errors(recording: Recording, inside: Callable[[Array], Array]) -> Errors:
    trial = run_trial(make("ekf" if recording.instruments.imu is not None else "ship-ekf"), recording)
    truth = recording.data.truth
    assert trial.covariance is not None
    error = relative_position(trial.position, truth.position)[:, :2]
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(trial.covariance[:, :2, :2]), error)
    used = inside(truth.time) & np.isfinite(nees)
    return Errors(error[used], nees[used])


def _compared(recording: Recording) -> tuple[Errors, Errors]:
    """The errors in the second half, and those in outages of the second half."""
    half, end = 0.5 * recording.duration, recording.duration
    whole, away = _errors(recording, lambda t: t > half), list[Errors]()
    for k in range(_PLACES):
        first = half + 0.1 * _EVERY + k * _EVERY / _PLACES
        starts = np.arange(first, max(end - 0.5 * _OUTAGE, first + 1.0), _EVERY)
        spans = [(float(s), float(min(s + _OUTAGE, end))) for s in starts if s < end]
        if spans:
            away.append(_errors(with_outage(recording, spans), lambda t, s=spans: _within(t, s)))  # type: ignore[misc]
    return whole, _joined(away)


def _within(time: Array, spans: list[tuple[float, float]]) -> Array:
    return np.any([(time > a) & (time <= b) for a, b in spans], axis=0)


def _joined(found: list[Errors]) -> Errors:
    return Errors(np.concatenate([e.error for e in found]), np.concatenate([e.nees for e in found]))


def _taken(pairs: list[tuple[Errors, Errors]], number: int) -> list[tuple[Errors, Errors]]:
    """As many logs together; the last ones are left out if they are fewer."""
    parts = [pairs[k : k + number] for k in range(0, len(pairs) - number + 1, number)]
    return [(_joined([a for a, _ in part]), _joined([b for _, b in part])) for part in parts]


def _recorded(names: list[str], most: int) -> Iterator[Log]:
    for name in names:
        scenario = load(name).model_copy(update={"faults": ()})
        assert scenario.log is not None
        try:
            number = len(list_recordings(scenario.log))
        except LogError as error:
            print(f"left out: {error}", flush=True)
            continue
        for seed in range(min(most, number)):
            yield Log(f"{scenario.name} {seed}", scenario, lambda s, k=seed: record(s, k))  # type: ignore[misc]


def _simulated(runs: int, first: int, vessels: list[str]) -> Iterator[Log]:
    for name in vessels:
        for seed in range(first, first + runs):
            told, recording = voyage(name, seed)

            def with_sheets(scenario: Scenario, one: Recording = recording) -> Recording:
                return replace(one, instruments=scenario.instruments_sheet())

            yield Log(f"{name} {seed}", told, with_sheets, exact(name, seed))


def main(arguments: list[str] | None = None) -> None:
    """Fit one half of each log, and compare on the other."""
    folder = [str(p) for p in sorted(_FOLDER.glob("*.toml")) if p.stem != "sources"]
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("logs", nargs="*", help="scenarios, or with --simulated vessels; all")
    parser.add_argument("--recordings", type=int, default=6, help="of a scenario, at most")
    parser.add_argument("--simulated", type=int, default=0, help="voyages of each vessel, in place of recordings")
    parser.add_argument("--seed", type=int, default=0, help="the first voyage")
    parser.add_argument("--exact", action="store_true", help="right datasheets in place of fitted ones")
    parser.add_argument("--reference", action="store_true", help="a fit to simulated logs knows their truth, too")
    parser.add_argument("--together", type=int, default=1, help="logs that the ranges are asked of, taken together")
    parser.add_argument("--toml", action="store_true", help="print the figures that were fitted")
    chosen = parser.parse_args(arguments)
    if chosen.exact and not chosen.simulated:
        parser.error("--exact needs --simulated: of a recording nobody knows the right datasheets")
    warnings.simplefilter("ignore")
    if chosen.simulated:
        logs = _simulated(chosen.simulated, chosen.seed, chosen.logs or list(VESSELS))
    else:
        logs = _recorded(chosen.logs or [*_CATALOGUE, *folder], chosen.recordings)
    print(f"{'log':18s} {'datasheets':10s}    RMSE   NEES/2  within 95 %   in outages: RMSE   NEES/2  within 95 %")
    together: dict[str, dict[str, list[tuple[Errors, Errors]]]] = {}
    for log in logs:
        try:
            before = log.recording(log.scenario)
            other = log.exact if chosen.exact else _fitted(log, before, chosen)
        except LogError as error:
            print(f"left out: {error}", flush=True)
            continue
        assert other is not None
        for sheets, recording in (("today's", before), ("exact" if chosen.exact else "fitted", log.recording(other))):
            pair = _compared(recording)
            together.setdefault(log.name.rpartition(" ")[0], {}).setdefault(sheets, []).append(pair)
            _print(log.name, sheets, pair)
    print("\nall logs of a vessel together")
    for name, by_sheets in together.items():
        for sheets, pairs in by_sheets.items():
            _print(name, sheets, *_taken(pairs, len(pairs)))
    print(f"\nshare in the asked ranges, {chosen.together} at a time: {', '.join(_ASKED)}")
    shares: dict[str, list[list[bool]]] = {}
    for name, by_sheets in together.items():
        for sheets, pairs in by_sheets.items():
            groups = zip(_taken(pairs, chosen.together), _taken(by_sheets["today's"], chosen.together), strict=True)
            kept = [_kept(pair, today) for pair, today in groups]
            shares.setdefault(sheets, []).extend(kept)
            if kept:
                _print_shares(name, sheets, kept)
    for sheets, kept in shares.items():
        _print_shares("all", sheets, kept)


def _fitted(log: Log, before: Recording, chosen: argparse.Namespace) -> Scenario:
    found = identify(log.scenario, before, 0.5 * before.duration, chosen.reference or None)
    if chosen.toml:
        print(found.toml, *found.remarks, sep="\n")
    return Scenario.from_toml(found.table, source="fitted")


def _kept(pair: tuple[Errors, Errors], today: tuple[Errors, Errors]) -> list[bool]:
    """Whether a log's figures are in the ranges of `_ASKED`."""
    (_, nees, _), (_, away_nees, share) = (e.figures for e in pair)
    kept = [a <= f <= b for f, (a, b) in ((nees, _NEES), (away_nees, _NEES), (share, _REGION))]
    kept.append(all(a.figures[0] <= _RMSE * b.figures[0] for a, b in zip(pair, today, strict=True)))
    return [*kept, all(kept)]


def _print(name: str, sheets: str, pair: tuple[Errors, Errors]) -> None:
    (rmse, nees, share), (away_rmse, away_nees, away_share) = (e.figures for e in pair)
    print(f"{name:18s} {sheets:10s} {rmse:7.3g} {nees:8.2f} {share:12.3f} {away_rmse:18.3g} {away_nees:8.2f} "
          f"{away_share:12.3f}", flush=True)  # fmt: skip


def _print_shares(name: str, sheets: str, kept: list[list[bool]]) -> None:
    print(f"{name:18s} {sheets:10s}", *(f"{share:6.2f}" for share in np.mean(kept, axis=0)), f"of {len(kept)}")


if __name__ == "__main__":
    main()
