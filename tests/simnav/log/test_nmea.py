"""NMEA logs: sentences against hand-worked values, checksums, clocks."""

from __future__ import annotations

import math
import warnings
from datetime import UTC, datetime

import numpy as np
import pytest

from simnav.log.nmea import SENTENCES, read_nmea
from simnav.log.table import LogError, LogWarning
from simnav.watchers import watched


def checksum(body: str) -> str:
    total = 0
    for c in body.encode():
        total ^= c
    return f"${body}*{total:02X}"


def write(path, *lines):
    path.write_text("\n".join(lines) + "\n")
    return path


def test_sentences_by_hand(tmp_path):
    stamp = "2014-08-01T00:00:00.500000Z "
    file = read_nmea(
        write(
            tmp_path / "log",
            stamp + checksum("GPGGA,000000.25,2230.0000,S,01745.6000,W,1,06,1.3,033.6,M,-002.6,M,,"),
            stamp + checksum("GPVTG,210.0,T,,M,010.0,N,,K"),
            stamp + checksum("HEHDT,218.53,T"),
            stamp + checksum("PSXN,23,0.35,-1.74,218.26,0.58"),
            stamp + "$PUHAW,UVH,-5.0,0.0,270.0",
            stamp + checksum("VWVHW,90.0,T,,M,12.0,N,,K"),
        )
    )
    gga = file.table("GGA", "GP")
    assert math.degrees(gga.columns["latitude"][0]) == pytest.approx(-22.5, abs=1e-12)
    assert math.degrees(gga.columns["longitude"][0]) == pytest.approx(-17.76, abs=1e-12)
    assert gga.columns["height"][0] == pytest.approx(31.0)  # altitude above the geoid plus its separation
    knot = 1852.0 / 3600.0
    vtg = file.table("VTG")
    assert vtg.columns["velocity_north"][0] == pytest.approx(-10.0 * knot * math.sqrt(3.0) / 2.0)
    assert vtg.columns["velocity_east"][0] == pytest.approx(-10.0 * knot * 0.5)
    assert math.degrees(file.table("HDT").columns["heading"][0]) == pytest.approx(218.53)
    psxn = file.table("PSXN,23").columns
    assert [math.degrees(psxn[n][0]) for n in ("roll", "pitch", "heading")] == pytest.approx([0.35, -1.74, 218.26])
    uvh = file.table("PUHAW,UVH").columns  # 5 kn west, heading west: ahead
    assert uvh["speed"][0] == pytest.approx(5.0 * knot)
    assert uvh["speed_starboard"][0] == pytest.approx(0.0, abs=1e-12)
    assert file.table("VHW").columns["speed"][0] == pytest.approx(12.0 * knot)


def test_the_date_of_the_logger_counts_not_that_of_the_receiver(tmp_path):
    """A receiver 1024 weeks off, with a fix of the second before midnight that is logged after it."""
    file = read_nmea(
        write(
            tmp_path / "log",
            "2014-08-01T00:00:00.241000Z " + checksum("GPGGA,235959.226,2200.1,S,01756.3,W,1,06,1.3,33,M,-2,M,,"),
            "2014-08-01T00:00:00.305000Z " + checksum("GPRMC,235959.226,A,2200.1,S,01756.3,W,9.7,220.2,151294,,"),
            "2014-08-01T00:00:00.400000Z " + checksum("GPHDT,218.5,T"),
        )
    )
    midnight = datetime(2014, 8, 1, tzinfo=UTC).timestamp()
    for sentence in ("GGA", "RMC", "HDT"):  # HDT has no time of its own: that of the sentence before it
        assert file.table(sentence).columns["sentence"][0] - midnight == pytest.approx(-0.774, abs=1e-6)
    assert file.table("HDT").columns["logger"][0] - midnight == pytest.approx(0.4, abs=1e-6)


def test_checksums(tmp_path):
    good, bad = checksum("HEHDT,1.0,T"), checksum("HEHDT,2.0,T")[:-2] + "00"
    path = write(tmp_path / "log", good, bad, "$HEHDT,3.0,T", "garbage", checksum("HEHDT,x,T"))
    with pytest.warns(LogWarning) as warned:
        table = read_nmea(path).table("HDT")
    np.testing.assert_allclose(np.degrees(table.columns["heading"]), [1.0, 3.0])
    messages = sorted(str(w.message).split(": ", 1)[1] for w in warned)
    assert messages == [
        "1 lines have a bad checksum and are left out, the first is line 2",
        "2 lines are not understood and are left out, the first is line 4",
    ]
    np.testing.assert_array_equal(table.line, [1, 3])


def test_a_sentence_without_a_fix_is_no_measurement(tmp_path):
    path = write(tmp_path / "log", "$GPGGA,000001,,,,,0,,,,M,,M,,", "$GPGGA,000002,2200.1,N,00100.0,E,1,,,,M,,M,,")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(read_nmea(path).table("GGA")) == 1


@pytest.mark.parametrize(
    ("sentence", "talker", "message"),
    [
        ("GGA", "GN", "there is no sentence 'GNGGA'; did you mean 'GPGGA'"),
        ("XYZ", None, r"there is no sentence 'XYZ'.*sentences that are understood: GGA"),
        ("HDT", None, "several talkers say 'HDT': GP, HE; choose one by 'talker'"),
    ],
)
def test_the_choice_of_a_sentence(tmp_path, sentence, talker, message):
    path = write(tmp_path / "log", "$GPGGA,000002,2200.1,N,00100.0,E,1,,,,M,,M,,", "$GPHDT,1,T", "$HEHDT,1,T")
    with pytest.raises(LogError, match=message):
        read_nmea(path).table(sentence, talker)


def test_a_file_without_sentences(tmp_path):
    path = write(tmp_path / "log", "time,x", "1,2")
    with pytest.warns(LogWarning), pytest.raises(LogError, match="no NMEA sentence that is understood"):
        read_nmea(path)


def test_a_log_in_which_all_sentences_of_a_kind_are_invalid_says_so(tmp_path):
    invalid = checksum("GPGGA,000001.00,,,,,0,00,,,M,,M,,")
    file = read_nmea(write(tmp_path / "log", checksum("HEHDT,1.0,T"), invalid, invalid))
    assert len(file.table("HDT")) == 1
    expected = r"none of 2 sentences 'GPGGA' holds a measurement: .* invalid .*, the first is line 2"
    with pytest.raises(LogError, match=expected):
        file.table("GGA", "GP")
    with pytest.raises(LogError, match="none of 2 sentences 'GGA'"):
        read_nmea(write(tmp_path / "nothing", invalid, invalid)).table("GGA")
    with pytest.raises(LogError, match="there is no sentence 'GLL'"):
        file.table("GLL")


def test_a_sentence_that_says_that_it_is_invalid_is_not_used_but_its_time_is(tmp_path):
    place = "2200.1,N,00100.0,E"
    knots = "5.0,1.0"
    lines = []
    good = [f"GPGGA,{{}},{place},{q},09,0.9,1.0,M,0.0,M,," for q in "123459"]
    bad = [f"GPGGA,{{}},{place},{q},09,0.9,1.0,M,0.0,M,," for q in ("0", "6", "7", "8")]
    good += [f"GPRMC,{{}},A,{place},5.0,10.0,010524,,,{m}" for m in "ADFPR"] + [
        f"GPRMC,{{}},A,{place},5.0,10.0,010524,,"
    ]
    bad += [f"GPRMC,{{}},A,{place},5.0,10.0,010524,,,{m}" for m in "NEMS"] + [
        f"GPRMC,{{}},V,{place},5.0,10.0,010524,,,A"
    ]
    good += [f"GPGLL,{place},{{}},A", f"GPGLL,{place},{{}},A,D"]
    bad += [f"GPGLL,{place},{{}},V", f"GPGLL,{place},{{}},A,N"]
    for k, sentence in enumerate(good + bad):
        lines += [checksum(sentence.format(f"0000{k:02d}.00")), checksum("HEHDT,10.0,T")]
    lines += [checksum(f"GPVTG,10.0,T,,M,5.0,N,,K,{m}") for m in "ADN"]
    lines += [checksum(f"HETHS,10.0,{m}") for m in "AEMSV"]
    lines += [checksum(f"VDVBW,{knots},{a},{knots},{b}") for a, b in ("AA", "AV", "VA")]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        file = read_nmea(write(tmp_path / "log", *lines))
    counts = {sentence: len(file.table(sentence)) for _, sentence in file.tables}
    assert counts == {"GGA": 6, "RMC": 6, "GLL": 2, "HDT": len(good + bad), "VTG": 2, "THS": 1, "VBW": 3}
    np.testing.assert_allclose(file.table("HDT").columns["sentence"], np.arange(len(good + bad)))
    vbw = file.table("VBW").columns
    assert np.isnan(vbw["speed"]).tolist() == np.isnan(vbw["speed_starboard"]).tolist() == [False, False, True]
    assert np.isnan(vbw["ground_forward"]).tolist() == [False, True, False]


@pytest.mark.parametrize(
    "bad",
    [
        "GPGGA,240000,2200.1,N,00100.0,E,1,,,,M,,M,,", "GPGGA,126100,2200.1,N,00100.0,E,1,,,,M,,M,,",
        "GPGGA,120061,2200.1,N,00100.0,E,1,,,,M,,M,,", "GPGGA,120000,2200.1,E,00100.0,E,1,,,,M,,M,,",
        "GPGGA,120000,2200.1,N,00100.0,N,1,,,,M,,M,,", "GPGGA,120000,9000.1,N,00100.0,E,1,,,,M,,M,,",
        "GPGGA,120000,2260.0,N,00100.0,E,1,,,,M,,M,,", "GPGGA,120000,2200.1,N,18000.1,E,1,,,,M,,M,,",
        "GPGGA,120000,-2200.1,N,00100.0,E,1,,,,M,,M,,", "HEHDT,400.0,T", "HEHDT,inf,T",
    ],
)  # fmt: skip
def test_an_impossible_value_is_left_out_with_a_warning(tmp_path, bad):
    path = write(tmp_path / "log", checksum("GPGGA,000001,2200.1,N,00100.0,E,1,,,,M,,M,,"), checksum(bad), "$HEHDT,1,T")
    with pytest.warns(LogWarning, match="1 lines are not understood and are left out, the first is line 2"):
        file = read_nmea(path)
    assert (len(file.table("GGA")), len(file.table("HDT"))) == (1, 1)
    assert file.table("HDT").columns["sentence"][0] == 1.0


def test_midnight_a_leap_second_and_sentences_of_ais(tmp_path):
    lines = [f"$GPGGA,{t},2200.1,N,00100.0,E,1,,,,M,,M,," for t in ("235959.5", "235960.5", "000001.5")]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        file = read_nmea(write(tmp_path / "log", "!AIVDM,1,1,,A,13u?etPv2;0n:dDPwUM1U1Cb069D,0*24", *lines))
    np.testing.assert_allclose(np.diff(file.table("GGA").columns["sentence"]), [1.0, 1.0])


#: A good sentence of each type: what follows its name, and its name is a key of `SENTENCES`.
GOOD = {
    "GGA": "000000.25,2230.0000,S,01745.6000,W,1,06,1.3,033.6,M,-002.6,M,,",
    "GLL": "2230.0000,S,01745.6000,W,000000.25,A,A",
    "RMC": "000000.25,A,2230.0000,S,01745.6000,W,10.0,210.0,010814,,,A",
    "ZDA": "000000.25,01,08,2014,00,00",
    "VTG": "210.0,T,,M,010.0,N,,K,A",
    "HDT": "218.53,T",
    "THS": "218.53,A",
    "VHW": "90.0,T,,M,12.0,N,,K",
    "VBW": "12.0,0.5,A,11.0,0.4,A",
    "DPT": "20.5,1.2",
    "PSXN,23": "0.35,-1.74,218.26,0.58",
    "PUHAW,UVH": "-5.0,0.0,270.0",
    "GNS": "000000.25,2230.0000,S,01745.6000,W,AAN,12,0.9,33.6,-2.6,,",
    "GST": "000000.25,1.1,0.8,0.6,45.0,0.7,0.65,1.2",
    "HDG": "98.3,0.5,E,12.6,W",
    "HDM": "98.3,M",
    "ROT": "-3.5,A",
    "DBT": "36.4,f,11.1,M,6.0,F",
    "MTW": "12.5,C",
    "PASHR": "000000.25,218.5,T,0.35,-1.74,0.58,0.02,0.02,0.1,2,1",
    "PRDID": "-1.74,0.35,218.26",
    "PNORBT6": "TIME=1452244916.7508,DT1=1.234,DT2=-1.234,VX=0.5,VY=-0.1,VZ=0.02,FOM=0.004,"
    "D1=23.45,D2=23.4,D3=23.5,D4=23.6",
    "PNORBT7": "1452244916.7508,1.234,-1.234,0.5,-0.1,0.02,0.004,23.45,23.4,23.5,23.6",
    "PNORBT8": "TIME=1452244916.7508,DT1=1.234,DT2=-1.234,VX=0.5,VY=-0.1,VZ=0.02,FOM=0.004,"
    "D1=23.45,D2=23.4,D3=23.5,D4=23.6,BATT=23.4,SS=1500.0,PRESS=1.2,TEMP=12.3,STAT=0x000FFFFF",
    "PNORBT9": "1452244916.7508,1.234,-1.234,0.5,-0.1,0.02,0.004,23.45,23.4,23.5,23.6,23.4,1500.0,1.2,12.3,0x000FFFFF",
    "PSIMSSB": "000000.25,M23,A,,C,H,M,-100.10,50.50,200.20,1.436,N,,",
}
#: What Python reads as a number, or fails on, and no instrument sends.
STRANGE = ("inf", "-inf", "Infinity", "nan", "1e400", "1e5", "1_0", "\xb2", "0x10", "9" * 5000, "--1", ".")


def test_there_is_a_good_sentence_of_each_type():
    assert set(GOOD) == set(SENTENCES)


@pytest.mark.parametrize("sentence", SENTENCES)
def test_no_strange_number_is_taken_or_stops_the_reading(tmp_path, sentence):
    """In each field in turn: the line is left out, or the field is one that nobody reads."""
    name = sentence if sentence.startswith("P") else f"GP{sentence}"
    good = GOOD[sentence].split(",")
    path = write(tmp_path / "good", f"${name},{','.join(good)}")
    expected = {k: v[0] for k, v in read_nmea(path).table(sentence).columns.items()}
    refused = 0
    for i in range(len(good)):
        for k, strange in enumerate(STRANGE):
            fields = [*good[:i], strange, *good[i + 1 :]]
            path = write(tmp_path / f"{i}-{k}", f"${name},{','.join(good)}", f"${name},{','.join(fields)}")
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                table = read_nmea(path).table(sentence)
            if len(table) == 1:
                refused += bool(said)
            for column, values in table.columns.items():
                if values.dtype == object:
                    continue  # a name: any text
                assert values[-1] == pytest.approx(expected[column], nan_ok=True), (column, strange)
    assert refused >= len(STRANGE)  # at least one field of each type is a number


def test_a_magnetic_heading_becomes_true_by_the_last_variation(tmp_path):
    place = "2230.0000,S,01745.6000,W"
    path = write(
        tmp_path / "log",
        "$HCHDM,100.0,M",  # nothing is known yet
        f"$GPRMC,000000.25,A,{place},10.0,210.0,010814,12.5,W,A",
        "$HCHDM,100.0,M",
        "$HCHDG,101.0,1.0,W,10.0,E",
        "$HCHDG,101.0,,,,",
    )
    hdm = read_nmea(path).table("HDM").columns
    assert np.isnan(hdm["heading"][0])
    assert np.degrees(hdm["heading"][1]) == pytest.approx(87.5)
    assert np.degrees(read_nmea(path).table("HDG").columns["heading"]) == pytest.approx([110.0, 111.0])


def test_the_variation_does_not_take_a_heading_out_of_the_circle(tmp_path):
    path = tmp_path / "a.nmea"
    path.write_text("$HCHDG,359.0,2.0,E,8.5,E\n$HCHDM,355.0,M\n$HCHDG,1.0,,,3.0,W\n$HCHDM,359.5,M\n")
    file = read_nmea(path)
    hdg = file.table("HDG")
    assert np.degrees(hdg.column("heading_magnetic")[1]) == pytest.approx([1.0, 1.0])
    assert np.degrees(hdg.column("heading")[1]) == pytest.approx([9.5, -2.0])
    assert np.degrees(file.table("HDM").column("heading")[1]) == pytest.approx([3.5, 356.5])


def test_a_usbl_fix_has_the_axes_that_it_says(tmp_path):
    path = write(
        tmp_path / "log",
        "$PSIMSSB,000000.25,M23,A,,C,H,M,-100.0,50.0,200.0,1.4,N,,",
        "$PSIMSSB,000001.25,M23,A,,C,E,M,-100.0,50.0,200.0,1.4,N,,*",
        "$PSIMSSB,000002.25,M23,V,,C,H,M,-100.0,50.0,200.0,1.4,N,,",
    )
    found = read_nmea(path).table("PSIMSSB").columns
    assert [found[n][0] for n in ("forward", "starboard", "depth")] == [50.0, -100.0, 200.0]
    assert [found[n][1] for n in ("north", "east")] == [100.0, 50.0]
    assert len(found["depth"]) == 2
    assert list(found["transponder"]) == ["M23", "M23"]


def test_a_long_log_tells_how_far_it_has_been_read(tmp_path):
    line = "2014-08-01T00:00:00.5Z $HEHDT,98.5,T"
    path = write(tmp_path / "long.nmea", *[line] * 25_000)
    told = []
    with watched(lambda file, done, total: told.append((file.name, done, total))):
        read_nmea(path)
    size = path.stat().st_size
    assert told == [("long.nmea", 10_000 * (len(line) + 1), size), ("long.nmea", 20_000 * (len(line) + 1), size)]
