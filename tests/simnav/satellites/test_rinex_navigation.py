"""RINEX navigation files: three versions give the same ephemerides, and a wrong file gets a sentence with its line."""

from __future__ import annotations

import gzip
import random

import numpy as np
import pytest

from simnav.satellites.rinex_navigation import NavigationFileError, read_navigation
from simnav.sensors.gnss_raw import SHIPPED

HEADER_2 = """     2.11           N: GPS NAV DATA                         RINEX VERSION / TYPE
    3.2596D-08  7.4506D-09 -1.7881D-07  0.0000D+00          ION ALPHA
    1.3517D+05  0.0000D+00 -2.6214D+05  1.3107D+05          ION BETA
                                                            END OF HEADER
"""
HEADER_4 = """     4.00           NAVIGATION DATA     M                   RINEX VERSION / TYPE
                                                            END OF HEADER
> ION G12 LNAV
    2023 03 12 00 08 54 3.259600000000e-08 7.450600000000e-09-1.788100000000e-07
     0.000000000000e+00 1.351700000000e+05 0.000000000000e+00-2.621400000000e+05
     1.310700000000e+05
> STO C21 CNVX
    2023 03 12 00 20 00 BDGA
     2.286000000000e+03-2.502929419279e-08 2.664535259100e-14 6.776263578034e-21
"""


@pytest.fixture(scope="module")
def text() -> str:
    return SHIPPED.read_text()


@pytest.fixture(scope="module")
def lines(text) -> list[str]:
    """The header, then the messages of G01, E01, C01 and C30."""
    given = text.splitlines()
    end = next(k for k, line in enumerate(given) if "END OF HEADER" in line) + 1
    kept = given[:end]
    for satellite in ("G01", "E01", "C01", "C30"):
        at = next(k for k, line in enumerate(given) if line.startswith(satellite))
        kept += given[at : at + 8]
    return kept


def written(tmp_path, content: str):
    path = tmp_path / "nav.rnx"
    path.write_text(content)
    return path


def test_three_versions_and_gzip(tmp_path, lines):
    wanted = read_navigation(written(tmp_path, "\n".join(lines)))
    assert wanted.satellite == ("G01", "E01", "C01", "C30")
    (tmp_path / "nav.rnx.gz").write_bytes(gzip.compress("\r\n".join(lines).encode()))
    first = next(k for k, line in enumerate(lines) if line.startswith("G01"))
    records = [lines[k : k + 8] for k in range(first, len(lines), 8)]
    names = ("G01 LNAV", "E01 INAV", "C01 D2", "C30 D1")
    fourth = HEADER_4 + "".join(
        f"> EPH {name}\n" + "\n".join(record) + "\n" for name, record in zip(names, records, strict=True)
    )
    second = HEADER_2 + " 1 23  3 12 12  0  0.0" + records[0][0][23:].replace("e", "D") + "\n"
    second += "\n".join(line[1:].replace("e", "D") for line in records[0][1:])
    for other in (
        read_navigation(tmp_path / "nav.rnx.gz"),
        read_navigation(written(tmp_path, fourth)),
        read_navigation(written(tmp_path, second)),
    ):
        n = len(other)
        assert other.satellite == wanted.satellite[:n]
        np.testing.assert_array_equal(other.numbers, wanted.numbers[:n])
        np.testing.assert_array_equal(other.klobuchar, wanted.klobuchar)
    assert n == 1


def test_the_messages_of_other_systems_and_of_fnav_are_passed_over(tmp_path, lines):
    first = next(k for k, line in enumerate(lines) if line.startswith("E01"))
    fnav = lines[first : first + 8]
    fnav[5] = fnav[5][:23] + " 2.580000000000e+02" + fnav[5][42:]
    glonass = ["R01 2023 03 12 11 45 00 1.0e-05 0.0 0.0", *["     1.0e+04 1.0 0.0 0.0"] * 3]
    table = read_navigation(written(tmp_path, "\n".join([*lines, *fnav, *glonass])))
    assert table.satellite == ("G01", "E01", "C01", "C30")


@pytest.mark.parametrize(
    ("line", "change", "message"),
    [
        (1, lambda t: t.replace("RINEX VERSION", "A VERSION"), r"nav.rnx, line 1: .*begins with a line 'RINEX VERSION"),
        (1, lambda t: t.replace("3.04", "7.00"), r"nav.rnx, line 1: version '7.00' should be 2, 3 or 4"),
        (1, lambda t: t.replace("N: GNSS NAV", "OBSERVATION"), r"line 1: the type 'OBSERVATION.*begin with N"),
        (10, lambda t: t.replace("END", "THE"), r"nav.rnx: the header should end with a line 'END OF HEADER'"),
        (7, lambda t: t.replace("3.2596e-08", "3.2596x-08"), r"line 7: a coefficient of GPSA = '3.2596x-08' should be"),
        (
            11,
            lambda t: t.replace("2023 03 12", "2023 13 12"),
            r"line 11: the epoch of G01, '2023 13 12.*time from 1980",
        ),
        (11, lambda t: t.replace("G01", "G0x"), r"line 11: 'G0x' should be a satellite, like 'G05'"),
        (11, lambda t: " " + t, r"line 11: a record should begin here"),
        (13, lambda t: t[:23] + " " * 19 + t[42:], r"line 13: the ephemeris of G01 lacks its eccentricity"),
        (
            13,
            lambda t: t[:23] + " 1.250129658729e+02" + t[42:],
            r"line 13: the eccentricity of G01, 125.013, should be",
        ),
        (14, lambda t: t[:4] + " 4.320000000000e+05" + t[23:], r"line 14: the reference times .* of G01 are 216000 s"),
        (17, lambda t: t[:23], r"line 17: the ephemeris of G01 lacks its health"),
        (18, lambda t: "", r"line 11: the ephemeris of G01 has 7 lines; it should have 8"),
    ],
)
def test_a_wrong_file_is_named_with_its_line(tmp_path, lines, line, change, message):
    content = [*lines]
    content[line - 1] = change(content[line - 1])
    with pytest.raises(NavigationFileError, match=message):
        read_navigation(written(tmp_path, "\n".join(content)))


def test_no_file_and_no_ephemeris(tmp_path, lines):
    with pytest.raises(NavigationFileError, match=r"absent.rnx: the navigation file cannot be read: No such file"):
        read_navigation(tmp_path / "absent.rnx")
    with pytest.raises(NavigationFileError, match=r"nav.rnx: there is no ephemeris of GPS, Galileo or BeiDou in it"):
        read_navigation(written(tmp_path, "\n".join(lines[:10])))
    with pytest.raises(NavigationFileError, match=r"the navigation file cannot be read: it is no regular file"):
        read_navigation(tmp_path)
    (tmp_path / "broken.gz").write_bytes(gzip.compress(b"x" * 1000)[:-5])
    with pytest.raises(NavigationFileError, match=r"broken.gz: the navigation file cannot be read"):
        read_navigation(tmp_path / "broken.gz")


def test_a_thousand_mutated_files_are_read_or_refused_with_a_sentence(tmp_path, lines):
    rng = random.Random(35)
    sentences = []
    for _ in range(1000):
        content = bytearray("\n".join(lines).encode())
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(content))
            action = rng.randrange(4)
            if action == 0:
                content[at] = rng.randrange(256)
            elif action == 1:
                del content[at : at + rng.choice((1, 20, 81))]
            elif action == 2:
                content[at:at] = rng.choice((b"\n", b" ", b"9", b"-", b"\x00", b"1e999", b"\xff\xfe"))
            else:
                content[at : at + 19] = b" " * 19
        path = tmp_path / "mutated.rnx"
        path.write_bytes(bytes(content))
        try:
            table = read_navigation(path)
        except NavigationFileError as error:
            sentences.append(str(error))
        else:
            assert np.isfinite(table.numbers).all()
            time = table.numbers[0, :1]
            states = table.states(list(dict.fromkeys(table.satellite)), time)
            assert not np.isinf(states.position).any()
    assert 300 < len(sentences) < 1000
    assert all(s.startswith("mutated.rnx") and "\n" not in s for s in sentences)
