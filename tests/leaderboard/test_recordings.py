"""Public recordings: what is declared, and from downloaded files to a scenario."""

from __future__ import annotations

import hashlib
import tomllib

import pytest

import simnav
from simnav.leaderboard import recordings
from simnav.leaderboard.results.errors import RequestError
from simnav.scenario import load


def test_twelve_recordings_of_six_sources_and_four_kinds_of_vessel():
    found = simnav.recordings()
    assert sum(one.number for one in found) >= 12
    assert len({one.source.name for one in found}) >= 6
    assert len({one.vessel for one in found}) >= 4
    for one in found:
        assert one.source.licence
        assert one.source.citation
        scenario = load(one.scenario if one.catalogued else one.toml)
        assert scenario.name == one.scenario
        log = scenario.log
        names = [log.recordings] if isinstance(log.recordings, str) else log.recordings
        assert one.number == len(names)
        if log.folder.startswith("gtsam:"):
            assert one.state == "ready"
            continue
        wanted = {f"{log.folder}/{f.path.replace('{recording}', n)}" for f in log.files.values() for n in names}
        assert {f.path for f in one.files} == wanted
        assert all(len(f.sha256) == 64 for f in one.files)
        assert one.catalogued or scenario.track == "recordings"


@pytest.fixture
def pond(tmp_path, monkeypatch):
    """One scenario of two files, and a folder in which they lie under other names."""
    folder, downloads = tmp_path / "known", tmp_path / "downloads" / "deep"
    folder.mkdir()
    downloads.mkdir(parents=True)
    source = (recordings._FOLDER / "sail-aava.toml").read_text()
    (folder / "pond.toml").write_text(source.replace('name = "sail-aava"', 'name = "pond"'))
    files = ""
    for name in ("a", "b"):
        content = name.encode() * 1000
        (downloads / f"{name} (1).bin").write_bytes(content)
        digest = hashlib.sha256(content).hexdigest()
        files += f'[[recordings.files]]\npath = "pond/{name}.csv"\nfrom = "{name}"\nbytes = 1000\nsha256 = "{digest}"\n'
    (folder / "sources.toml").write_text(
        '[[source]]\nname = "s"\ntitle = "S"\naddress = "somewhere"\nlicence = "MIT"\ncitation = "nobody"\n'
        '[[recordings]]\nscenario = "pond"\nsource = "s"\nvessel = "raft"\nnumber = 1\ncommit = ""\n' + files
    )
    monkeypatch.setattr(recordings, "_FOLDER", folder)
    return tmp_path


def test_downloaded_files_become_a_scenario(pond):
    data = pond / "data"
    (before,) = simnav.recordings(output=data)
    assert (before.state, len(before.missing)) == ("absent", 2)
    (some,) = simnav.recordings([pond / "downloads" / "deep" / "a (1).bin"], output=data)
    assert (some.state, some.missing, some.written) == ("incomplete", ("pond/b.csv",), "")
    (whole,) = simnav.recordings([pond / "downloads"], scenarios="pond", output=data)
    assert whole.state == "ready"
    assert (data / "pond" / "b.csv").read_bytes() == b"b" * 1000
    assert tomllib.loads((data / "pond.toml").read_text())["name"] == "pond"
    assert whole.written == str(data / "pond.toml")


def test_what_is_no_recording_is_refused(pond):
    data = pond / "data"
    other = pond / "other.bin"
    other.write_bytes(b"c" * 1000)
    with pytest.raises(RequestError, match=r"other\.bin: no file has the checksum of one of pond"):
        simnav.recordings([other], output=data)
    with pytest.raises(RequestError, match="there is no such file or folder"):
        simnav.recordings([pond / "nowhere"], output=data)
    with pytest.raises(RequestError, match="there are no public recordings 'pnd'; did you mean 'pond'"):
        simnav.recordings(scenarios="pnd")
    (data / "pond").mkdir(parents=True)
    (data / "pond" / "a.csv").write_text("mine")
    with pytest.raises(RequestError, match=r"a\.csv: another file has this name"):
        simnav.recordings([pond / "downloads"], output=data)
