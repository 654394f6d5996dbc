"""Scenarios: reading, checking across tables, finding; and the sentence that each class of mistake gets."""

from __future__ import annotations

import math
import subprocess
import sys
import textwrap
import tomllib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from simnav.scenario import Scenario, load, names, parse
from simnav.scenario.catalogue import ScenarioWarning, headers
from simnav.spec import SpecError
from simnav.world.start import POLAR
from tests.cases.packages import install_pack

TOML = """
name = "test-run"
version = 3
title = "A test"
duration_s = 60.0
water_depth_m = 50.0

[start]
latitude_deg = 54.0
longitude_deg = 10.0
speed_m_s = 5.0

[initial_error]
position_m = [1.0, 2.0, 3.0]
velocity_m_s = [0.1, 0.2, 0.3]
attitude_deg = [1.0, 2.0, 3.0]

[vessel]
kind = "uuv"

[[manoeuvre]]
kind = "turn"
angle_deg = 90.0

[[manoeuvre]]
kind = "dive"
depth_m = 20.0

[sea]
significant_height_m = 1.0
peak_period_s = 7.0

[instruments.imu]
rate_hz = 100.0

[instruments.imu.gyroscope]
bias_deg_h = 1.0

[instruments.gnss]
kind = "gnss_position"
sigma_m = [1.0, 1.0, 2.0]
lever_arm_m = [0.0, 0.0, -3.0]

[instruments.dvl]
rate_hz = 2.0
sigma_m_s = 0.01

[[fault]]
kind = "outage"
instruments = ["gnss"]
start_s = 20.0
end_s = 30.0
"""

RECORDED = """
name = "recorded-run"
version = 1
title = "A log"
duration_s = 60.0

[instruments.gnss]
kind = "gnss_position"
sigma_m = 2.0

[log.files.fixes]
path = "{recording}.csv"

[log.instruments.gnss]
file = "fixes"
columns = ["latitude", "longitude", "height"]
units = ["deg", "deg", "m"]

[log.reference.position]
file = "fixes"
columns = ["latitude", "longitude", "height"]
units = ["deg", "deg", "m"]
"""


def test_identity():
    scenario = parse(TOML)
    assert (scenario.id, scenario.gym_id) == ("test-run-v3", "simnav/TestRun-v3")
    assert not scenario.recorded
    assert scenario.epochs == 60


def test_datasheets():
    sheets = parse(TOML).instruments_sheet()
    assert list(sheets) == ["gnss", "dvl"]
    assert sheets["gnss"].kind == "gnss_position"
    assert sheets["dvl"].rate == 2.0
    np.testing.assert_array_equal(sheets["gnss"].lever_arm, [0.0, 0.0, -3.0])
    assert sheets.step == 1.0
    assert sheets.imu is not None
    assert sheets.imu.gyroscope.bias == pytest.approx(math.radians(1.0) / 3600.0)


def test_without_an_imu():
    text = TOML.replace("[instruments.imu]\nrate_hz = 100.0\n\n[instruments.imu.gyroscope]\nbias_deg_h = 1.0\n", "")
    scenario = parse(text)
    assert scenario.imu is None
    assert scenario.instruments_sheet().imu is None
    assert list(scenario.aids) == ["gnss", "dvl"]


def test_initial_covariance():
    covariance = parse(TOML).initial_error.covariance()
    sigma = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3, *np.radians([1.0, 2.0, 3.0])]
    np.testing.assert_allclose(covariance, np.diag(np.square(sigma)))


def test_round_trip():
    for text in (TOML, RECORDED):
        scenario = parse(text)
        assert Scenario.from_toml(scenario.to_toml()) == scenario


def test_content_hash_tells_what_matters():
    reference = parse(TOML).content_hash()
    # Words, the order of keys and a default that is written out change nothing.
    assert parse(TOML.replace("A test", "Another title")).content_hash() == reference
    assert parse(TOML.replace("[sea]", '[sea]\nspectrum = "jonswap"')).content_hash() == reference
    assert parse("duration_s = 60.0\n" + TOML.replace("duration_s = 60.0\n", "")).content_hash() == reference
    # Numbers, the version and the name do.
    for old, new in (("bias_deg_h = 1.0", "bias_deg_h = 1.1"), ("version = 3", "version = 4"), ("54.0", "54.5")):
        assert parse(TOML.replace(old, new)).content_hash() != reference


def test_content_hash_is_the_same_in_another_process():
    code = f"from simnav.scenario import parse; print(parse({TOML!r}).content_hash())"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == parse(TOML).content_hash()


def test_a_recorded_scenario_has_no_world():
    scenario = parse(RECORDED)
    assert scenario.recorded
    assert scenario.start is None
    assert list(scenario.instruments_sheet()) == ["gnss"]


# ------------------------------------------------------------------------------------------------ bad input


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        # unknown key, wrong unit, missing key
        ("water_depth_m", "water_deep_m", "unknown key 'water_deep_m' (value 50.0); did you mean 'water_depth_m'?"),
        ("rate_hz = 2.0", "rate = 2.0", "unknown key 'instruments.dvl.rate' (value 2.0); it is given in hz: 'rate_hz'"),
        (
            "speed_m_s = 5.0",
            "speed_kn = 5.0",
            "unknown key 'start.speed_kn' (value 5.0); it is given in m_s: 'speed_m_s'",
        ),
        ("duration_s = 60.0", "", "required key 'duration_s' is missing"),
        ("sigma_m_s = 0.01", "", "required key 'instruments.dvl.sigma_m_s' is missing"),
        (
            "latitude_deg = 54.0\nlongitude_deg = 10.0",
            "",
            "required keys 'start.latitude_deg' and 'start.longitude_deg' are missing",
        ),
        # wrong sign, range, type
        ("rate_hz = 2.0", "rate_hz = 2e6", "instruments.dvl.rate_hz = 2e+06: should be at most 100000"),
        ("rate_hz = 2.0", "rate_hz = -2.0", "instruments.dvl.rate_hz = -2.0: should be greater than 0"),
        ("latitude_deg = 54.0", "latitude_deg = 91.0", f"start.latitude_deg = 91.0: {POLAR}"),
        (
            "significant_height_m = 1.0",
            "significant_height_m = -1.0",
            "sea.significant_height_m = -1.0: should be at least 0",
        ),
        ("version = 3", "version = 0", "version = 0: should be at least 1"),
        ("rate_hz = 2.0", 'rate_hz = "2"', "instruments.dvl.rate_hz = '2' should be a number"),
        ("latitude_deg = 54.0", "latitude_deg = nan", "start.latitude_deg = nan should be a finite number"),
        (
            "lever_arm_m = [0.0, 0.0, -3.0]",
            "lever_arm_m = [0.0]",
            "instruments.gnss.lever_arm_m = [0.0]: should have 3 numbers",
        ),
        # covariance
        (
            "position_m = [1.0, 2.0, 3.0]",
            "position_m = [1.0, 0.0, 3.0]",
            "initial_error.position_m = [1.0, 0.0, 3.0]: the initial covariance must be positive definite: "
            "every sigma should be greater than 0",
        ),
        # kinds
        ('kind = "turn"', 'kind = "tern"', "manoeuvre[0].kind = 'tern' is unknown; did you mean 'turn'?"),
        (
            'kind = "uuv"',
            'kind = "uuvs"',
            "vessel.kind = 'uuvs' is unknown; did you mean 'uuv'?",
        ),
        ('kind = "outage"', 'kind = "outages"', "fault[0].kind = 'outages' is unknown; did you mean 'outage'?"),
        (
            "[instruments.dvl]",
            '[instruments.dvl]\nkind = "gyrocompas"',
            "instruments.dvl.kind = 'gyrocompas' is unknown; did you mean 'gyrocompass'?",
        ),
        # name, duration, step
        (
            '"test-run"',
            '"Test Run"',
            "name = 'Test Run' should be in kebab-case and without a version, like 'coastal-voyage'",
        ),
        (
            '"test-run"',
            '"test-run-v3"',
            "name = 'test-run-v3' should be in kebab-case and without a version, like 'coastal-voyage'",
        ),
        ("duration_s = 60.0", "duration_s = 60.4", "duration_s = 60.4 should be a multiple of step_s = 1, like 60"),
        ("duration_s = 60.0", "duration_s = inf", "duration_s = inf: should be at most 1e+07"),
        (
            "duration_s = 60.0",
            "duration_s = 60.0\nstep_s = 0.125",
            "step_s = 0.125 should be a multiple of the IMU's sample interval, 1 / 100 Hz",
        ),
        # vessel, water
        ('kind = "uuv"', 'kind = "ship"', "manoeuvre[1].kind = 'dive': a ship cannot; say vessel.kind = 'uuv'"),
        ("depth_m = 20.0", "depth_m = 80.0", "manoeuvre[1].depth_m = 80 is below the sea bed, water_depth_m = 50"),
        ("speed_m_s = 5.0", "depth_m = 60.0", "start.depth_m = 60 is below the sea bed, water_depth_m = 50"),
        # instruments
        (
            "[instruments.dvl]",
            '[instruments.DVL]\nkind = "dvl"',
            "instruments.DVL: a name is of lower-case letters, digits and underscores",
        ),
        (
            "[instruments.dvl]",
            '[instruments.depth]\nkind = "dvl"',
            "instruments.depth.kind = 'dvl': 'depth' is no name for it, it means something else",
        ),
        (
            "[instruments.dvl]\nrate_hz = 2.0\nsigma_m_s = 0.01",
            '[instruments.second]\nkind = "imu"\nrate_hz = 100.0',
            "instruments.second.kind = 'imu': the IMU, and only the IMU, is called 'imu'",
        ),
        # faults
        ('["gnss"]', '["gnns"]', "fault[0] 'outage': there is no instrument 'gnns'; did you mean 'gnss'?"),
        ("start_s = 20.0", "start_s = 40.0", "fault[0]: the fault ends (30.0 s) before it starts (40.0 s)"),
        (
            "start_s = 20.0\nend_s = 30.0",
            "start_s = 60.0\nend_s = 70.0",
            "fault[0] 'outage': it starts at 60 s, but duration_s = 60",
        ),
        (
            'kind = "outage"',
            'kind = "bias_step"\noffset_m_s = 1.0',
            "fault[0] 'bias_step': 'offset_m_s' is of no use to gnss (gnss_position); that takes 'offset_m'",
        ),
        (
            'kind = "outage"',
            'kind = "noise_step"\nfactor = 2.0\nsigma_m_s = 1.0',
            "fault[0]: a noise_step has either a factor or a new sigma (sigma_m, sigma_m_s, sigma_deg)",
        ),
        (
            'kind = "outage"',
            'kind = "bias_step"',
            "fault[0] 'bias_step' on 'gnss' (gnss_position): required key 'offset_m' is missing",
        ),
        (
            "start_s = 20.0\nend_s = 30.0",
            f"intervals_s = {[[i, i + 0.5] for i in range(33)]}",
            "fault: 33 intervals are too many; the labels have room for 32",
        ),
    ],
)
def test_bad_input(old, new, sentence):
    assert TOML.count(old) >= 1
    with pytest.raises(SpecError) as caught:
        parse(TOML.replace(old, new, 1), source="run.toml")
    assert str(caught.value) == f"run.toml: {sentence}"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[log.files", "[sea]\nsignificant_height_m = 1.0\npeak_period_s = 6.0\n[log.files",
         "sea: a recorded run ([log]) has no simulated world; leave it out"),
        ("[log.instruments.gnss]", "[log.instruments.gnns]",
         "log.instruments.gnns: there is no [instruments.gnns] datasheet; did you mean 'gnss'?"),
        ("[log.files", "[instruments.gnss_2]\nkind = 'gnss_position'\nsigma_m = 1.0\n[log.files",
         "instruments.gnss_2: the log says not where it comes from; add [log.instruments.gnss_2]"),
        ("[log.files", "[instruments.imu]\nrate_hz = 100.0\n[log.files",
         "[instruments.imu] needs [log.imu] beside it"),
    ],
)  # fmt: skip
def test_bad_input_to_a_recorded_scenario(old, new, sentence):
    with pytest.raises(SpecError) as caught:
        parse(RECORDED.replace(old, new, 1), source="run.toml")
    assert str(caught.value) == f"run.toml: {sentence}"


def test_a_simulated_run_needs_a_start():
    table = tomllib.loads(TOML)
    del table["start"]
    with pytest.raises(SpecError, match=r"^f: required table \[start\] is missing"):
        Scenario.from_toml(table, source="f")


def test_a_run_needs_an_instrument():
    table = tomllib.loads(TOML)
    table["instruments"], table["fault"] = {}, []
    with pytest.raises(SpecError, match=r"^f: there is no instrument; add at least one table \[instruments.NAME\]$"):
        Scenario.from_toml(table, source="f")


# ------------------------------------------------------------------------------------------------ finding and reading


def test_load_a_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(TOML)
    assert load(path) == load(str(path)) == parse(TOML)


def test_malformed_toml_is_told_with_its_line(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('name = "a"\nversion = \n')
    with pytest.raises(SpecError, match=rf"^{path}: not valid TOML: .*line 2"):
        load(path)


def test_files_that_cannot_be_read(tmp_path):
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SpecError, match=r"binary.toml: not a TOML file, for it is not UTF-8 text$"):
        load(binary)
    with pytest.raises(SpecError, match=f"^{tmp_path}: cannot be read: "):
        load(tmp_path)
    with pytest.raises(SpecError, match=r"nowhere/x.toml: no such file$"):
        load("nowhere/x.toml")
    with pytest.raises(SpecError, match=r"^open-sea.toml: no such file; did you mean the scenario 'open-sea'\?$"):
        load("open-sea.toml")


def test_unknown_scenarios_name_the_nearest():
    with pytest.raises(SpecError, match=r"^there is no scenario 'coastal-voyge'; did you mean 'coastal-voyage'\?$"):
        load("coastal-voyge")
    with pytest.raises(SpecError, match=r"^there is no scenario 'open-sea-v99'; there is open-sea-v1$"):
        load("open-sea-v99")
    with pytest.raises(SpecError, match=r"^there is no scenario 'qqqq'; valid here: .*open-sea"):
        load("qqqq")


# ------------------------------------------------------------------------------------------------ packs


def test_a_pack_adds_its_scenarios_and_the_newest_version_wins(tmp_path, monkeypatch):
    newer = TOML.replace("version = 3", "version = 4").replace("A test", "A newer test")
    install_pack(tmp_path, "mypack", {"mypack/__init__.py": "", "mypack/old.toml": TOML, "mypack/new.toml": newer})
    monkeypatch.syspath_prepend(tmp_path)
    assert "test-run" in names()
    assert load("test-run").version == 4
    assert load("test-run-v3").title == "A test"


def test_a_pack_is_read_without_running_it(tmp_path, monkeypatch):
    install_pack(tmp_path, "rude", {"rude/__init__.py": "raise SystemExit(1)", "rude/a.toml": TOML})
    monkeypatch.syspath_prepend(tmp_path)
    assert "test-run" in names()


@pytest.mark.parametrize(
    ("files", "warning"),
    [
        ({}, "scenario pack 'broken' .* left out: there is no package 'broken'"),
        ({"broken.py": ""}, "'broken' is a module; a pack is a package"),
        ({"broken/__init__.py": "", "broken/x.toml": "name =\n"}, r"x.toml: left out, not valid TOML: .*line 1"),
        ({"broken/__init__.py": "", "broken/x.toml": "name = 'A'"}, r"x.toml: left out, name = 'A' should be in kebab"),
        ({"broken/__init__.py": "", "broken/x.toml": "name = 'a'"}, r"x.toml: left out, version = None should be"),
        (
            {"broken/__init__.py": "", "broken/x.toml": TOML.replace("test-run", "open-sea").replace("= 3", "= 1")},
            r"x.toml: left out, .*open-sea.toml already has the id 'open-sea-v1'",
        ),
    ],
)
def test_a_broken_pack_is_a_warning_and_harms_nobody(files, warning, tmp_path, monkeypatch):
    before = names()
    install_pack(tmp_path, "broken", files)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(ScenarioWarning, match=warning):
        assert names() == before


def test_names_that_differ_only_in_hyphens_do_not_share_a_gymnasium_id(tmp_path, monkeypatch):
    one, two = TOML.replace("test-run", "run-a1"), TOML.replace("test-run", "run-a-1")
    install_pack(tmp_path, "mypack", {"mypack/__init__.py": "", "mypack/a.toml": one, "mypack/b.toml": two})
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(ScenarioWarning, match="b.toml: left out"):
        found = headers()
    assert len({h.gym_id for h in found}) == len(found)


def test_a_folder_scenarios_in_the_working_directory_does_not_shadow_the_catalogue(tmp_path):
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "__init__.py").write_text("raise RuntimeError('shadowed')")
    code = "from simnav.scenario.catalogue import headers; print([h.id for h in headers()])"
    out = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert "open-sea-v1" in out


def test_heads_are_read_without_the_heavy_libraries():
    code = textwrap.dedent("""
        import sys
        import simnav
        from simnav.scenario.catalogue import headers
        assert headers()
        heavy = {"pydantic", "numba", "gtsam", "scipy", "matplotlib", "pyarrow"} & set(sys.modules)
        assert not heavy, heavy
    """)
    subprocess.run([sys.executable, "-c", code], check=True)


# ------------------------------------------------------------------------------------------------ nonsense everywhere


def _paths(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    for key, value in node.items() if isinstance(node, dict) else enumerate(node):
        yield (*path, key)
        if isinstance(value, (dict, list)):
            yield from _paths(value, (*path, key))


@pytest.mark.parametrize("text", [TOML, RECORDED], ids=["simulated", "recorded"])
def test_nonsense_anywhere_gives_one_sentence_or_a_scenario(text):
    nonsense = [-1, 0, 1e300, math.nan, math.inf, True, "", "x", [], [1], [[1, 2]], {}, {"a": 1}, [{}], [{"kind": []}]]
    refused = 0
    for path in _paths(tomllib.loads(text)):
        for value in nonsense:
            table: Any = tomllib.loads(text)
            node = table
            for key in path[:-1]:
                node = node[key]
            node[path[-1]] = value
            try:
                scenario = Scenario.from_toml(table, source="run.toml")
            except SpecError as error:
                refused += 1
                sentence = str(error)
                assert sentence.startswith("run.toml: ")
                assert "\n" not in sentence
                assert "pydantic" not in sentence
                assert "tuple" not in sentence.lower()
            else:
                assert Scenario.from_toml(scenario.to_toml()) == scenario
                assert math.isfinite(scenario.instruments_sheet().step)
    assert refused > 300


@pytest.mark.parametrize("given", [None, 3, ["open-sea"]])
def test_what_is_no_name_and_no_path_is_refused_in_one_sentence(given):
    with pytest.raises(SpecError, match="is not a scenario; a name or the path of a TOML file is wanted"):
        load(given)


def test_a_scenario_is_one_line_at_the_prompt() -> None:
    assert repr(load("open-sea")) == "<Scenario: open-sea-v1, Open sea on a clean day, 900 s>"
