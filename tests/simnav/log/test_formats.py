"""Each registered format: what is read is what was written, and a mutated file is no traceback."""

from __future__ import annotations

import struct
import sys

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from simnav.log import LogError, LogWarning
from simnav.log.files import FileSpec
from simnav.log.formats.gps_time import leap_seconds
from simnav.log.inspection import streams_of
from simnav.log.reader import READERS
from tests.audit.mutations import mutations
from tests.cases.log_files import CASES, HEIGHT, LATITUDE, LONGITUDE, OTHERS, N, T, read

_NEEDS = {"hdf5": "h5py", "mcap": "mcap", "rosbag": "rosbags"}


def test_there_is_a_case_of_every_format_of_simnav():
    ours = {name for name, reader in READERS.items().items() if reader.__module__.startswith("simnav.")}
    assert set(CASES) == ours


@pytest.fixture(params=CASES)
def form(request):
    if request.param in _NEEDS:
        pytest.importorskip(_NEEDS[request.param])
    return request.param


def test_mutated_files_are_read_or_refused(form):
    """`python -m tests.audit mutations` tries 3000 of each."""
    found = mutations(form, 12, seed=1)
    assert set(found) <= {"read", "refused"}, found


@pytest.mark.parametrize("case", OTHERS)
def test_further_contents_are_read_or_refused(case):
    """With other messages inside right checksums, too."""
    if OTHERS[case].form == "mcap":
        pytest.importorskip("mcap")
    found = mutations(case, 12, seed=1)
    assert set(found) <= {"read", "refused"}, found


def test_a_column_of_parquet_whose_name_is_no_text_is_refused(tmp_path):
    path = tmp_path / "a.parquet"
    parquet.write_table(pa.table({"time": [0.0, 1.0], "mode": [1.0, 2.0]}), path, store_schema=False)
    path.write_bytes(path.read_bytes().replace(b"mode", b"mod\xe9"))
    with pytest.raises(LogError, match="it is no Parquet file, or damaged"):
        read("parquet", path)


def test_a_folder_or_nothing_in_place_of_the_file_is_named(form, tmp_path):
    for path, what in ((tmp_path, "a folder|cannot be read|no such file"), (tmp_path / "x", "no such file")):
        with pytest.raises(LogError, match=what) as raised:
            read(form, path)
        assert ": reader " not in str(raised.value)


@pytest.fixture
def good(tmp_path):
    def make(form, **keys):
        path = tmp_path / f"good{CASES[form].ending}"
        if not path.exists():
            CASES[form].make(path)
        return read(form, path, **keys)

    make.folder = tmp_path
    return make


def test_rtklib(good):
    rows = good("rtklib")
    np.testing.assert_allclose(rows.table.column("latitude")[1], LATITUDE, atol=1e-9)
    np.testing.assert_allclose(rows.table.column("height")[1], HEIGHT, atol=1e-4)
    assert rows.table.column("Q")[1].tolist() == [1.0, 2.0] * 6
    assert rows.time[0] == 1714557600.0 - 18.0  # 2024-05-01 10:00:00 of GPS time
    path = good.folder / "week.pos"
    path.write_text("% UTC a b c\n%  UTC latitude(deg) longitude(deg) height(m)\n2312 295200.5 54.0 7.9 1.0\n")
    assert read("rtklib", path).time[0] == 1714557600.5
    path.write_text("2312 295200.5 54.0\n")
    with pytest.raises(LogError, match="line 1: 1 values after the time where the header names"):
        read("rtklib", path)


def test_leap_seconds():
    assert leap_seconds(np.array([362793599.0, 362793600.0, 1483228799.0, 1483228800.0])).tolist() == [0, 1, 17, 18]


def test_tum(good):
    rows = good("tum")
    assert np.degrees(rows.table.column("yaw")[1][0]) == pytest.approx(2.0 * np.degrees(np.arctan2(0.6, 0.8)))
    # East-north-up and forward-left-up, as ROS has it: counterclockwise from the east.
    turned = good("tum", options={"frame": "enu"}).table.column("yaw")[1][0]
    assert np.degrees(turned) == pytest.approx(90.0 - 2.0 * np.degrees(np.arctan2(0.6, 0.8)))
    with pytest.raises(LogError, match=r"options.frame = 'x' should be 'ned' or 'enu'"):
        good("tum", options={"frame": "x"})
    path = good.folder / "bad.tum"
    path.write_text("1 0 0 0 0 0 0 1\n2 0 0 0 0.9 0.9 0.9 0.9\n")
    with pytest.raises(LogError, match=r"bad\.tum, line 2: the quaternion has the length 1\.8"):
        read("tum", path)


def test_euroc_and_kf_gins(good):
    assert good("euroc").time == pytest.approx(T)
    assert good("kf_gins").table.column("dvel_z")[1] == pytest.approx(-9.8)
    gnss = good("kf_gins", options={"content": "gnss"}).table
    assert gnss.names[1:4] == ("latitude", "longitude", "height")
    path = good.folder / "five.txt"
    path.write_text("1 2 3 4 5\n")
    with pytest.raises(LogError, match=r"5 columns; a KF-GINS file has 7"):
        read("kf_gins", path)
    with pytest.raises(LogError, match=r"5 columns; a EuRoC file has 7"):
        read("euroc", path)


def test_sbet(good):
    table = good("sbet").table
    assert np.degrees(table.column("longitude")[1]) == pytest.approx(LONGITUDE)
    speed = np.hypot(table.column("velocity_north")[1], table.column("velocity_east")[1])
    assert speed == pytest.approx(np.hypot(2.0, 1.0))
    assert table.column("velocity_north")[1][0] == pytest.approx(2.0 * np.cos(0.3) - 1.0 * np.sin(0.3))
    assert table.column("heading")[1][0] == pytest.approx(0.7)
    path = good.folder / "cut.out"
    path.write_bytes((good.folder / "good.out").read_bytes()[:-5])
    with pytest.warns(LogWarning, match=r"the last record, at offset 1496, has 131 bytes where .* has 136"):
        assert len(read("sbet", path).table) == 11
    path.write_text("0,1,2,3\n" * 100)
    with pytest.raises(LogError, match="it is text, and no binary file as format = 'sbet' wants"):
        read("sbet", path)


def test_an_mcap_file_that_is_cut_off_is_read_as_far_as_it_goes(tmp_path):
    """A recorder that was switched off has written no index."""
    writer = pytest.importorskip("mcap.writer")
    path = tmp_path / "a.mcap"
    with open(path, "wb") as stream:
        out = writer.Writer(stream, chunk_size=100, compression=writer.CompressionType.NONE)
        out.start()
        channel = out.register_channel("/fix", "json", 0)
        for k in range(50):
            out.add_message(channel, 10**9 * k, b'{"latitude": 54.0}', 10**9 * k)
        out.finish()
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.index((10**9 * 30).to_bytes(8, "little"))])
    with pytest.warns(LogWarning, match="no index, since its recorder did not end well; it is cut off or damaged"):
        rows = read("mcap", path, clock="logger")
    assert 20 < len(rows.table) <= 30
    assert rows.time[:20] == pytest.approx(np.arange(20.0))
    (stream,) = streams_of(path)
    assert stream.sentence == "/fix"
    assert "has no index" in stream.notes[0]


def test_a_last_row_of_rtklib_that_is_cut_off_is_left_out(good):
    good("rtklib")
    text = (good.folder / f"good{CASES['rtklib'].ending}").read_text().splitlines()
    path = good.folder / "cut.pos"
    path.write_text("\n".join(text)[:-9])
    with pytest.warns(LogWarning, match="the last row has 5 cells where the first line has 8; it is incomplete"):
        assert len(read("rtklib", path).table) == 11
    path.write_text("\n".join([*text[:-3], text[-3][:-9], *text[-2:]]))
    with pytest.raises(LogError, match="line 12: 5 cells where the first line has 8"):
        read("rtklib", path)


def test_pd0(good):
    with np.errstate(all="raise"):
        table = good("pd0").table
    assert table.column("ground_forward")[1][1:] == pytest.approx(1.5)
    assert np.isnan(table.column("ground_forward")[1][0])  # a velocity that is missing
    assert table.column("ground_starboard")[1][1] == pytest.approx(-0.1)
    assert table.column("range_4")[1][0] == pytest.approx(20.3)
    assert np.degrees(table.column("heading")[1][0]) == pytest.approx(45.0)
    assert good("pd0").time[:2].tolist() == [1714557600.5, 1714557601.5]
    content = bytearray((good.folder / "good.pd0").read_bytes())
    content[100] ^= 1
    path = good.folder / "bad.pd0"
    path.write_bytes(bytes(content) + struct.pack("<2sH", b"\x7f\x7f", 400))
    with pytest.warns(LogWarning, match="1 ensembles of PD0 are damaged or cut off and are left out, the first is at"):
        assert len(read("pd0", path).table) == N - 1


def test_pd6(good):
    rows = good("pd6")
    assert rows.time[:2] == pytest.approx([1714557600.0, 1714557600.01])
    table = rows.table
    assert np.isnan(table.column("ground_forward")[1][0])  # its status is V
    for name, value in (
        ("ground_forward", 1.5), ("ground_starboard", -0.1), ("ground_down", -0.02), ("velocity_north", 1.2),
        ("velocity_east", 0.3), ("velocity_down", 0.03), ("x", 0.01), ("error", 0.001), ("range_to_bottom", 20.5),
        ("depth", 12.3), ("speed_of_sound", 1500.0), ("heading", np.radians(45.0)), ("pitch", np.radians(-1.5)),
    ):  # fmt: skip
        assert table.column(name)[1][1] == pytest.approx(value)


def test_n2k(good):
    place = good("n2k").table
    assert np.degrees(place.column("latitude")[1]) == pytest.approx(LATITUDE, abs=1e-7)
    reader, path = READERS.get("n2k"), good.folder / "good.raw"

    def table(pgn, talker=None, **keys):
        return reader.read(path, FileSpec(path="x", format="n2k", **keys), pgn, talker).table

    heading = table("127250")
    assert heading.column("heading_magnetic")[1][0] == pytest.approx(2.4294)
    assert heading.column("heading")[1][0] == pytest.approx(2.4294 + 0.0698)
    speed = table("128259", "115")
    assert speed.column("speed")[1][0] == pytest.approx(3.24)
    assert np.isnan(speed.column("speed_over_ground")[1][0])  # not available
    fix = table("129029")  # in seven frames
    assert np.degrees(fix.column("latitude")[1][0]) == pytest.approx(60.0051, abs=1e-12)
    assert [fix.column(n)[1][0] for n in ("height", "satellites", "hdop", "pdop", "separation")] == pytest.approx(
        [2.43, 11, 0.8, 1.6, 15.0]
    )
    # 2014-08-15 19:00:00.5 by the receiver, in the line of 0.042 s; headings after it have its clock.
    later = reader.read(path, FileSpec(path="x", format="n2k", clock="sentence"), "127250")
    assert later.time[later.counts][0] == 1408129201.5
    assert len(later.counts) == N - 1
    with pytest.raises(LogError, match=r"there is no sentence '127251'; did you mean '\d*127250'\?"):
        table("127251")
    with pytest.raises(LogError, match=r"there is no sentence '60928'.* \(sentences that are understood: 126992"):
        table("60928")


def test_ubx(good):
    rows = good("ubx")
    assert rows.time == pytest.approx(1714557600.5 + T)
    table = rows.table
    assert np.degrees(table.column("longitude")[1]) == pytest.approx(LONGITUDE, abs=1e-7)
    for name, value in (("height", 47.1), ("velocity_east", -0.3), ("sigma_horizontal", 0.014), ("carrier", 2.0)):
        assert table.column(name)[1][3] == pytest.approx(value)
    path = good.folder / "good.ubx"
    attitude = READERS.get("ubx").read(path, FileSpec(path="x", format="ubx"), "NAV-ATT")
    assert attitude.time == pytest.approx(1714557601.0 + T)  # half a second after the other, by the time of the week
    assert np.degrees(attitude.table.column("heading")[1][0]) == pytest.approx(90.0)
    content = bytearray(path.read_bytes())
    content[60] ^= 1
    path.write_bytes(bytes(content))
    with pytest.warns(LogWarning, match="1 messages of UBX are damaged or cut off and are left out, the first is at"):
        assert len(read("ubx", path).table) == N - 1


def test_ubx_against_another_reader(good):
    pyubx2 = pytest.importorskip("pyubx2")
    table = good("ubx").table
    with open(good.folder / "good.ubx", "rb") as stream:
        theirs = [m for _, m in pyubx2.UBXReader(stream, protfilter=2) if m.identity == "NAV-PVT"]
    assert len(theirs) == N
    for name, field, scale in (
        ("latitude", "lat", np.pi / 180.0), ("velocity_north", "velN", 1e-3), ("sigma_height", "vAcc", 1e-3),
        ("course", "headMot", np.pi / 180.0), ("pdop", "pDOP", 1.0),
    ):  # fmt: skip
        assert table.column(name)[1] == pytest.approx([scale * getattr(m, field) for m in theirs])


def test_rinex(good):
    rows = good("rinex")
    assert rows.time == pytest.approx(1714557600.5 - 18.0 + T)
    assert rows.table.column("C1C")[1] == pytest.approx(22000000.125 + T)
    assert np.isnan(rows.table.column("S1C")[1][0])
    path = good.folder / "good.obs"
    galileo = READERS.get("rinex").read(path, FileSpec(path="x", format="rinex"), "E11").table
    assert galileo.names == ("time", "C1C")
    text = path.read_text()
    path.write_text(text.replace("     3.04", "     2.11"))
    with pytest.raises(LogError, match=r"line 1: version '2\.11' of RINEX; 3 and 4 are read"):
        read("rinex", path)
    path.write_text(text.replace("END OF HEADER", "COMMENT"))
    with pytest.raises(LogError, match="it has no END OF HEADER"):
        read("rinex", path)


@pytest.mark.parametrize("form", ["n2k", "pd6", "ubx", "rinex"])
def test_an_unknown_file_is_recognised(good, form):
    good(form)
    path = good.folder / f"good{CASES[form].ending}"
    streams = streams_of(path.rename(path.with_suffix(".any")))
    assert {s.form for s in streams} == {form}
    assert all(len(s.time) for s in streams)


def test_named_arrays(good):
    assert good("mat").table.column("imu.acc_3")[1] == pytest.approx(-9.8)
    with pytest.raises(LogError, match=r"name the array of the times, .*; there are: imu.t 12, imu.acc 12x3"):
        good("mat", time=1)
    with pytest.raises(LogError, match=r"there is no array 'imu.T'; did you mean 'imu.t'\?"):
        good("mat", time="imu.T")
    with pytest.raises(LogError, match=r"the array 'imu.acc' of the times is 12x3, no vector"):
        good("mat", time="imu.acc")
    pytest.importorskip("h5py")
    assert good("hdf5").table.column("imu/acc_2")[1] == pytest.approx(0.1)


def test_parquet(good):
    rows = good("parquet")
    assert rows.time == pytest.approx(1.7e9 + T)
    assert rows.table.column("place.lat")[1] == pytest.approx(LATITUDE)


@pytest.mark.parametrize("form", ["mcap", "rosbag"])
def test_bags(good, form):
    pytest.importorskip(_NEEDS[form])
    rows = good(form)
    assert rows.time == pytest.approx(T + 0.5)
    assert rows.table.column("latitude")[1] == pytest.approx(LATITUDE)
    assert len(good(form, clock="logger").time) == N
    path = good.folder / f"good{CASES[form].ending}"
    with pytest.raises(LogError, match="there is no topic '/fox'; did you mean '/fix'"):
        READERS.get(form).read(path, FileSpec(path="x"), "/fox")
    with pytest.raises(LogError, match=r"say which topic \(sentence\); there are: /fix"):
        READERS.get(form).read(path, FileSpec(path="x"))


def test_mcap_with_protobuf(tmp_path):
    """A message with a stamp, a number that keeps its default, and a repeated field."""
    pytest.importorskip("mcap")
    pytest.importorskip("google.protobuf")
    path = tmp_path / "a.mcap"
    OTHERS["mcap, protobuf"].make(path)
    rows = read("mcap", path)
    assert rows.time == pytest.approx(T + 0.5)
    assert rows.table.column("latitude")[1] == pytest.approx(LATITUDE)
    assert rows.table.column("height")[1].tolist() == [0.0] * N
    assert rows.table.column("covariance_2")[1].tolist() == [2.0] * N


def test_dataflash(good):
    rows = good("dataflash")
    assert rows.time == pytest.approx(T)
    assert rows.table.column("Lat")[1] == pytest.approx(LATITUDE, abs=1e-7)
    assert rows.table.column("Alt")[1] == pytest.approx(HEIGHT, abs=0.006)
    path = good.folder / "good.bin"
    assert {s.sentence for s in streams_of(path)} == {"GPS", "GPS[1]", "MSG"}
    reader = READERS.get("dataflash")
    with pytest.raises(LogError, match=r"there are no messages 'GPX'; did you mean 'GPS'"):
        reader.read(path, FileSpec(path="x"), "GPX")
    with pytest.raises(LogError, match=r"say which messages \(sentence\); there are: GPS, GPS\[1\], MSG"):
        reader.read(path, FileSpec(path="x"))
    content = path.read_bytes()
    path.write_bytes(content[:-40] + b"\x00" * 7 + content[-40:-3])
    with pytest.warns(LogWarning, match="stretches of bytes are no messages of the log and are left out"):
        assert len(read("dataflash", path).table) == N
    path.write_bytes(content[:300])
    with pytest.raises(LogError, match=r"no whole message with a time \(TimeUS\)"):
        read("dataflash", path)


def test_ulog(good):
    rows = good("ulog")
    assert rows.time == pytest.approx(T)
    assert rows.table.names == ("timestamp", "latitude_deg", "longitude_deg", "sigma_1", "sigma_2", "fix_type")
    assert rows.table.column("longitude_deg")[1] == pytest.approx(LONGITUDE)
    assert rows.table.column("sigma_2")[1].tolist() == [2.0] * N
    path = good.folder / "good.ulg"
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.warns(LogWarning, match="the last message, at offset .* is cut off"):
        assert len(read("ulog", path).table) == N - 1


@pytest.mark.parametrize("form", ["mat", "hdf5", "mcap", "rosbag", "dataflash", "ulog"])
def test_a_binary_file_given_as_a_table_is_named(good, form):
    if form in _NEEDS:
        pytest.importorskip(_NEEDS[form])
    good(form)
    with pytest.raises(LogError, match=f"and no text as format = 'csv' wants; say format = '{form}'"):
        read("csv", good.folder / f"good{CASES[form].ending}")


@pytest.mark.parametrize(("form", "library"), [("hdf5", "h5py"), ("mcap", "mcap"), ("rosbag", "rosbags")])
def test_a_library_that_is_missing_is_named(good, monkeypatch, form, library):
    path = good.folder / f"any{CASES[form].ending}"
    path.write_bytes(b"0")
    for module in [m for m in sys.modules if m.partition(".")[0] == library]:
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.setattr("simnav.log.formats.hdf5.find_spec", lambda name: None)
    with pytest.raises(LogError, match=rf"needs the library {library}: pip install 'simnav\[logs\]'"):
        read(form, path)
