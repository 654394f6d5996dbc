"""RINEX files of recordings: RTKLIB opens them and is at the antenna, and our reader gives the same numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.geometry.earth import displace
from simnav.geometry.ecef import ecef_from_geodetic
from simnav.geometry.rotation import dcm_from_rpy
from simnav.leaderboard.results.formats import write
from simnav.log.formats.rinex import read_rinex
from simnav.recording import Recording
from simnav.satellites.orbit import SPEED_OF_LIGHT
from simnav.satellites.point_solution import solve
from simnav.sensors.gnss_raw import SHIPPED
from simnav.sensors.gnss_receiver import corrected_ranges
from simnav.simulation.simulator import simulate
from tests.cases.raw_gnss import raw_gnss

DURATION, FEW, STRENGTH, TROPOSPHERE = 12.0, (5.0, 8.0), 8, 10
ARM = np.array([-3.0, 0.0, -12.0])
NOTHING = dict.fromkeys(
    ("sigma_pseudorange", "sigma_range_rate", "signal_error", "multipath", "ionosphere_error", "troposphere_error"), 0.0
)
OUTAGE = f"""
[[fault]]
kind = "outage"
instruments = "gnss"
channels = ["G11", "G12", "G28", "E27", "E36"]
start_s = {FEW[0]}
end_s = {FEW[1]}
"""


@pytest.fixture(scope="module")
def recording():
    """Without errors but for the clock of the receiver; for three seconds there are three satellites."""
    scenario = raw_gnss(DURATION, OUTAGE)
    exact = scenario.aids["gnss"].model_copy(update={**NOTHING, "clock_bias": 3e5})
    return simulate(scenario.model_copy(update={"instruments": {**scenario.instruments, "gnss": exact}}), 4)


@pytest.fixture(scope="module")
def file(recording, tmp_path_factory):
    [path] = write("recording", "rinex", recording, tmp_path_factory.mktemp("rinex") / "a.rinex")
    return path


def antenna(recording) -> np.ndarray:
    """True positions of the antenna, Earth-fixed [m]."""
    truth = recording.data.truth
    return ecef_from_geodetic(displace(truth.position, np.einsum("nij,j->ni", dcm_from_rpy(truth.attitude), ARM)))


def test_point_solutions_of_rtklib_are_at_the_antenna(recording, file):
    """To a centimetre with equal corrections, and as the solutions of simnav; to half a metre with RTKLIB's own."""
    rtklib = pytest.importorskip("tests.simnav.satellites.rtklib")
    stream, sheet = recording.data.aids["gnss"], recording.instruments["gnss"]
    truth, found = antenna(recording), rtklib.points(str(file), str(SHIPPED), None)
    delay = {(s, round(t)): d for s, t, d in zip(names(stream), stream.time, stream.side[:, TROPOSPHERE], strict=True)}
    equal = rtklib.points(str(file), str(SHIPPED), lambda name, second: delay[name, round(second - 43200.0)])
    solved = [t for t in range(1, round(DURATION) + 1) if not FEW[0] <= t < FEW[1]]
    assert sorted(equal) == sorted(found) == solved
    for second in solved:
        rows = np.flatnonzero(abs(stream.time - second) < 1e-6)
        ours = ecef_from_geodetic(solve(corrected_ranges(stream, slice(rows[0], rows[-1] + 1), sheet)).position)
        assert np.linalg.norm(equal[second] - truth[second - 1]) < 0.01
        assert np.linalg.norm(equal[second] - ours) < 0.01
        assert np.linalg.norm(found[second] - truth[second - 1]) < 0.5


def names(stream) -> list[str]:
    return [stream.channels[k] for k in stream.channel]


def test_the_reader_gives_the_same_numbers(recording, file):
    """Epochs are those of the receiver's clock, a millisecond off at most; ranges lack the clock of the satellite."""
    stream, tables = recording.data.aids["gnss"], read_rinex(file)
    bias = []
    for number, name in enumerate(stream.channels):
        rows, table = stream.channel == number, tables.table(name)
        raw, at = table.column("C1C")[1], table.column("time")[1] % 86400.0 - 43200.0 + 18.0
        np.testing.assert_allclose(table.column("S1C")[1], stream.side[rows, STRENGTH], atol=6e-4)
        less = (raw - stream.value[rows, 0]) / SPEED_OF_LIGHT  # the clock of the satellite
        assert 1e-8 < abs(less[0]) < 2e-3
        np.testing.assert_allclose(less, less[0], atol=1e-9)
        shift = -table.column("D1C")[1] * SPEED_OF_LIGHT / 1575.42e6
        np.testing.assert_allclose(shift, stream.value[rows, 1], atol=0.01)
        bias.append(np.column_stack([stream.time[rows], at - stream.time[rows]]))
    time, bias = np.concatenate(bias).T
    stated = {round(e - b): b for e, b in epochs(file)}
    assert abs(bias).max() > 1e-5
    np.testing.assert_allclose(bias, [stated[round(t)] for t in time], atol=2e-6)


def epochs(file) -> list[tuple[float, float]]:
    """Seconds after noon, and the error of the receiver's clock, of each epoch."""
    lines = [line for line in file.read_text().splitlines() if line.startswith(">")]
    return [(60.0 * int(line[16:18]) + float(line[18:29]), float(line[41:])) for line in lines]


def test_lines_have_the_columns_of_the_format(file):
    head, _, body = file.read_text().partition("END OF HEADER\n")
    assert head.startswith("     3.05           OBSERVATION DATA    M                   RINEX VERSION / TYPE\n")
    assert all(len(line) > 60 and line[60:].strip() == line[60:] for line in head.splitlines()[:-1])
    counts = [int(line[32:35]) for line in body.splitlines() if line.startswith(">")]
    assert counts == [8, 8, 8, 8, 3, 3, 3, 8, 8, 8, 8, 8]
    assert sum(counts) + len(counts) == len(body.splitlines())


def test_what_has_no_place_in_a_file_is_said(tmp_path, recording):
    sheet = recording.instruments["gnss"]
    two = replace(sheet, details={**sheet.details, "frequencies": 2})
    other = replace(recording, instruments=type(recording.instruments)([two], recording.instruments.imu, 1.0))
    with pytest.raises(ValueError, match="gnss: RINEX has no code for the combination of two frequencies"):
        write("recording", "rinex", other, tmp_path / "a.rinex")
    with pytest.raises(ValueError, match="no raw observations of satellites"):
        write("recording", "rinex", replace(recording, origins={}), tmp_path / "a.rinex")


def test_a_stored_recording_still_has_its_date(tmp_path, recording, file):
    recording.save(tmp_path / "a.npz")
    [path] = write("recording", "rinex", Recording.load(tmp_path / "a.npz"), tmp_path / "a.rinex")
    assert path.read_text() == file.read_text()
