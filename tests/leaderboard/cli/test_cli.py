"""The `simnav` command: every command in-process, its JSON, its exit codes and its errors."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from simnav.leaderboard import cli
from simnav.leaderboard.cli.commands import COMMANDS, GROUPS, HEADINGS, MOVED
from tests.cases import POND

SCENARIO = (
    POND.replace("duration_s = 30.0", "duration_s = 60.0")
    + """
[[fault]]
kind = "outage"
instruments = ["gnss_position"]
start_s = 20.0
end_s = 40.0
"""
)

MINE = '''
from simnav import Estimate, Estimator, UnsuitableScenario, register

@register("mine")
class Mine(Estimator):
    """Keeps the last fix."""

    def __init__(self, gain: float = 1.0, choice: str = ""):
        self.gain, self.choice = gain, choice

    @property
    def needs(self):
        return ("terrain_fix",) if self.choice == "unsuitable" else ("gnss_position",)

    def reset(self, start, instruments):
        print("noise on standard output")
        if self.choice == "raise":
            raise RuntimeError("broken on purpose")
        if self.choice == "refuse":
            raise UnsuitableScenario("too hard")
        self.position = start.position.copy()

    def update(self, measurements):
        for m in measurements:
            self.position = self.position + self.gain * (m.value - self.position)
        return Estimate(measurements.time, self.position.copy())
'''

REST = ["--estimator", "gnss-only"]


@pytest.fixture
def here(tmp_path, monkeypatch, clean_registry) -> Path:
    """A working directory with a short scenario and an estimator."""
    (tmp_path / "pond.toml").write_text(SCENARIO)
    (tmp_path / "mine.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*words: str, code: int = 0):
    result = CliRunner().invoke(cli.app, [str(w) for w in words])
    assert result.exit_code == code, (result.exit_code, result.stdout, result.stderr)
    return result


def document(*words: str, code: int = 0):
    """What ``--json`` prints: one document and nothing else."""
    result = call(*words, "--json", code=code)
    return json.loads(result.stdout, parse_constant=lambda c: pytest.fail(f"{c} in JSON"))


def complaint(*words: str, code: int = 2) -> str:
    """The one sentence on standard error."""
    result = call(*words, code=code)
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stderr.startswith("simnav: ")
    return result.stderr


# -- list, version, help -------------------------------------------------------------------------------


def test_version():
    assert call("--version").stdout.startswith("simnav 0.")


@pytest.mark.parametrize("topic", ["scenarios", "estimators", "instruments", "faults", "imus"])
def test_list_shows_the_same_to_people_and_machines(topic):
    entries = document("list", topic)[topic]
    assert entries
    shown = call("list", topic).stdout
    for entry in entries:
        assert entry.get("name", entry.get("kind")) in shown


def test_list_without_a_topic_shows_scenarios_and_estimators():
    found = document("list")
    assert {"open-sea", "coastal-voyage"} <= {s["name"] for s in found["scenarios"]}
    assert {e["name"]: e["reference"] for e in found["estimators"]}["oracle"] is True


@pytest.mark.parametrize("topic", ["scenarios", "estimators", "instruments", "faults"])
@pytest.mark.parametrize("width", ["80", "120"])
def test_a_list_has_one_line_for_each_and_the_whole_name_first(topic, width, monkeypatch):
    monkeypatch.setenv("COLUMNS", width)
    entries = document("list", topic)[topic]
    lines = [line for line in call("list", topic).stdout.splitlines() if line.strip()]
    names = [e.get("name", e.get("kind")) for e in entries]
    below = lines[3:]  # the title, the columns, a line below them
    assert [line.split()[0] for line in below[: len(names)]] == names
    assert "'simnav show NAME' has the rest." in " ".join(below[len(names) :])
    assert max(map(len, lines)) <= int(width)


@pytest.mark.parametrize(("width", "track"), [("80", False), ("120", True)])
def test_a_narrow_list_leaves_out_the_track_so_that_titles_can_be_read(width, track, monkeypatch):
    monkeypatch.setenv("COLUMNS", width)
    shown = call("list", "scenarios").stdout
    assert "Open sea on a clean day" in shown
    assert ("aided-ins" in shown) is track


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("harbour-multipath", ["Scenario harbour-multipath-v2", "gyrocompass", "false zero"]),
        ("harbour-multipath-v2", ["Scenario harbour-multipath-v2"]),
        ("sw-fgo", ["Sliding-window factor graph", "window", "imu; aid", "fgo-simplified"]),
        ("fgo", ["Estimator sw-fgo"]),
        ("dvl", ["Instrument dvl", "sigma_m_s"]),
        ("outage", ["Fault outage", "start_s"]),
    ],
)
def test_show_tells_all_about_a_name(name, said):
    shown = call("show", name).stdout
    assert [text for text in said if text not in shown] == []
    assert document("show", name)


def test_show_of_an_unknown_name_names_those_that_are_near():
    assert "called 'sw-fog'; did you mean sw-fgo" in complaint_of(call("show", "sw-fog", code=2))


def test_show_takes_a_file_as_all_commands_do(here):
    assert "Keeps the last fix." in call("show", "mine.py").stdout
    assert document("show", "mine.py")["estimator"]["parameters"] == {"gain": 1.0, "choice": ""}
    shown = document("show", "pond.toml")["scenario"]
    assert (shown["duration"], shown["file"]) == (60.0, "pond.toml")
    assert "there is no estimator file 'nobody.py'" in complaint("show", "nobody.py")


def test_every_command_stands_under_one_heading_of_the_help():
    named = [name for names in HEADINGS.values() for name in names]
    assert sorted(named) == sorted({*COMMANDS, *GROUPS})
    shown = [line.split()[1] for line in call("--help").stdout.splitlines() if re.match(r"│ [a-z]", line)]
    assert shown == named
    assert len(named) <= 24


def test_old_names_say_where_the_command_went(tmp_path):
    for old, new in MOVED.items():
        assert old not in {*COMMANDS, *GROUPS}
        assert f"simnav {new} " in " ".join(call(*new.split(), "--help").stdout.split())
        assert f"'simnav {old}' is 'simnav {new}' now" in " ".join(call(old, code=2).stderr.split())
    run = entry("merge", "a", "b", "--output", "c", cwd=tmp_path)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr == "simnav: 'simnav merge' is 'simnav campaign merge' now\n"


def test_options_of_a_campaign_are_none_of_its_commands(tmp_path):
    run = entry("campaign", "-s", "pond.toml", "merge", "a", "-o", "b", cwd=tmp_path)
    said = "simnav: Invalid value for --scenario: options of 'simnav campaign merge' stand after it\n"
    assert (run.returncode, run.stderr) == (2, said)


def test_list_names_the_keys_of_instruments_and_faults():
    kinds = {i["kind"]: i["keys"] for i in document("list", "instruments")["instruments"]}
    assert "rate_hz" in kinds["dvl"]
    assert "imu" in kinds
    faults = {f["kind"]: f["keys"] for f in document("list", "faults")["faults"]}
    assert "instruments" in faults["outage"]


def test_list_loads_no_heavy_library():
    code = (
        "import sys; from typer.testing import CliRunner; from simnav.leaderboard import cli;"
        "assert CliRunner().invoke(cli.app, ['list']).exit_code == 0;"
        "print(*({'numba', 'gtsam', 'matplotlib', 'pyarrow', 'scipy', 'jinja2'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


def test_every_command_has_help_and_json():
    below = [[group, name] for group, (_, commands) in GROUPS.items() for name in commands]
    for words in [*([name] for name in COMMANDS), *below]:
        assert "--json" in call(*words, "--help").stdout


# -- run -------------------------------------------------------------------------------------------------


def test_run_scores_and_plots(here):
    found = document("run", "pond.toml", "--estimator", "gnss-only,mine.py", "--seed", "3", "--plot", "run.svg")
    assert (found["scenario"], found["seed"], found["duration"]) == ("pond-v1", 3, 60.0)
    assert [e["estimator"] for e in found["estimators"]] == ["gnss-only", "mine"]
    for e in found["estimators"]:
        assert e["status"] == "ok"
        assert 0.1 < e["scores"]["horizontal_rmse"] < 50.0
    assert found["scores"]["horizontal_rmse"]["unit"] == "m"
    drawn = Path(found["plot"]).read_text()
    assert ">North error [m]</text>" in drawn
    assert ">gnss_position fixes</text>" in drawn
    assert ">no gnss_position</text>" in drawn  # the outage


def test_run_is_the_same_again_but_for_the_times(here):
    def scores():
        found = document("run", "pond.toml", *REST)["estimators"][0]["scores"]
        return {k: v for k, v in found.items() if not k.startswith("update_")}

    assert scores() == scores()


def test_run_prints_a_table(here):
    shown = call("run", "pond.toml", *REST).stdout
    assert "pond-v1, seed 0" in shown
    assert "gnss-only" in shown


def test_parameters_change_the_outcome(here):
    def rmse(*words):
        return document("run", "pond.toml", *words)["estimators"][0]["scores"]["horizontal_rmse"]

    plain_one = rmse("-e", "mine.py")
    assert rmse("-e", "mine.py:gain=0.3") == rmse("-e", "mine.py", "--set", "gain=0.3") != plain_one
    two = document("run", "pond.toml", "-e", "mine.py:gain=0.3,mine.py:gain=0.6")["estimators"]
    assert [e["parameters"] for e in two] == [{"gain": "0.3"}, {"gain": "0.6"}]


def test_an_estimator_that_fails_is_a_failure(here):
    found = document("run", "pond.toml", "-e", "mine.py:choice=raise,gnss-only", code=1)
    assert {e["estimator"]: e["status"] for e in found["estimators"]} == {
        "mine(choice=raise)": "error",
        "gnss-only": "ok",
    }
    assert "broken on purpose" in found["estimators"][0]["reason"]


def test_an_estimator_that_does_not_suit_is_a_mistake_if_it_is_alone(here):
    result = call("run", "pond.toml", "-e", "mine.py:choice=unsuitable", code=2)
    assert "it needs terrain_fix; there is none" in result.stderr
    call("run", "pond.toml", "-e", "mine.py:choice=unsuitable,gnss-only")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run", "open-see"], "did you mean 'open-sea'"),
        (["run", "nowhere.toml"], "nowhere.toml"),
        (["run", "open-sea", "-e", "efk"], "did you mean 'ekf'"),
        (["run", "pond.toml", "-e", "nobody.py"], "nobody.py"),
        (["run", "pond.toml", "-e", "gnss-only:acceleration=x"], "acceleration"),
        (["run", "pond.toml", "-e", "gnss-only:gian=1"], "gian"),
        (["run", "pond.toml", "-e", "gain=1"], "'gain=1' is no estimator"),
        (["run", "pond.toml", "-e", "gnss-only", "--set", "acceleration"], "name=value"),
        (["run", "pond.toml", "-e", "gnss-only,ship-ekf", "--set", "nothing=1"], "nothing: none of the estimators"),
        (["run", "pond.toml", "--plot", "run.doc"], ".png, .svg or .pdf"),
        (["run", "broken.toml"], "broken.toml"),
        (["run", "wrong.toml"], "duration_s"),
        (["simulate", "pond.toml", "--output", "x.csv"], ".npz"),
        (["check", "nobody.py"], "nobody.py"),
        (["check", "syntax.py"], "line 1"),
        (["evaluate", "nobody.py", "-s", "pond.toml", "--runs", "2"], "nobody.py"),
        (["evaluate", "mine.py", "-s", "open-see"], "open-sea"),
        (["leaderboard", "nowhere"], "nowhere"),
        (["campaign", "-s", "pond.toml", "-e", "gnss-only", "-o", "."], "other files"),
        (["campaign", "-s", "pond.toml,pond.toml,open-see"], "open-sea"),
        (["log", "identify", "pond.toml", "--output", "nowhere/x.toml"], "there is no folder"),
        (["log", "twin", "pond.toml", "--output", "nowhere/x.toml"], "there is no folder"),
        (["new-estimator", "1"], "my-filter"),
        (["new-estimator", "ekf"], "already"),
        (["new-estimator", "fresh", "--output", "fresh.txt"], ".py"),
        (["new-estimator", "fresh", "--output", "nowhere/fresh.py"], "nowhere"),
    ],
)
def test_mistakes_get_one_sentence(here, words, says):
    (here / "broken.toml").write_text("name = ")
    (here / "wrong.toml").write_text(SCENARIO.replace("duration_s = 60.0\n[start]", "duration_s = -1.0\n[start]"))
    (here / "syntax.py").write_text("def (:\n")
    assert says in complaint(*words)


def test_mistakes_are_json_too_and_debug_shows_where(here):
    found = document("run", "open-see", code=2)
    assert found["code"] == 2
    assert "open-sea" in found["error"]
    result = call("run", "open-see", "--debug", code=2)
    assert "Traceback" in result.stderr


# -- simulate ----------------------------------------------------------------------------------------------


def test_simulate_writes_the_recording_and_its_csv(here):
    from simnav.recording import Recording

    found = document("simulate", "pond.toml", "--output", "pond.npz", "--csv", "tables", "--seed", "5")
    recording = Recording.load(Path(found["file"]))
    assert (recording.scenario, recording.seed) == ("pond-v1", 5)
    stream = recording.data.aids["gnss_position"]
    assert found["measurements"] == {"gnss_position": len(stream)}
    assert {Path(p).name for p in found["csv"]} == {
        "truth.csv", "gnss_position.csv", "README.md", "start.json",
    }  # fmt: skip
    fixes = np.genfromtxt(here / "tables" / "gnss_position.csv", delimiter=",", names=True)
    np.testing.assert_allclose(np.radians(fixes["latitude_deg"]), stream.value[:, 0], rtol=1e-15)
    np.testing.assert_array_equal(fixes["height_m"], stream.value[:, 2])
    truth = np.genfromtxt(here / "tables" / "truth.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(truth["velocity_north_m_s"], recording.data.truth.velocity[:, 0])
    np.testing.assert_allclose(np.radians(truth["yaw_deg"]), recording.data.truth.attitude[:, 2], rtol=1e-15)


# -- estimators ----------------------------------------------------------------------------------------------


def test_a_new_estimator_works_and_keeps_the_contract(here):
    found = document("new-estimator", "SlowFilter")
    assert found["name"] == "slow-filter"
    assert Path(found["file"]) == here / "slow_filter.py"
    report = document("check", "slow_filter.py")
    assert report["passed"]
    assert all(f["ok"] for f in report["findings"])
    run = document("run", "open-sea", "-e", "slow_filter.py,gnss-only")["estimators"]
    mine, gnss = (e["scores"]["horizontal_rmse"] for e in run)
    assert mine < 1.5 * gnss  # a start that is worth having
    before = (here / "slow_filter.py").read_text()
    assert "already" in complaint("new-estimator", "slow_filter.py")
    assert "exists" in complaint("new-estimator", "quick-filter", "--output", "slow_filter.py")
    assert (here / "slow_filter.py").read_text() == before


def test_check_fails_on_a_broken_estimator(here):
    found = document("check", "mine.py", "--set", "choice=raise", code=1)
    assert not found["passed"]
    assert "FAIL" in call("check", "mine.py", "--set", "choice=raise", code=1).stdout


# -- many runs -----------------------------------------------------------------------------------------------


def test_evaluate_shows_where_an_estimator_stands(here):
    words = [
        "evaluate",
        "mine.py",
        "--scenario",
        "pond.toml",
        "--runs",
        "3",
        "--against",
        "gnss-only",
        "--workers",
        "1",
    ]
    found = document(*words)
    assert found["estimator"] == "mine"
    assert found["seeds"] == [0, 1, 2]
    (stand,) = found["comparisons"]
    assert (stand["place"], stand["last"], stand["of"]) == (1, 2, 2)  # three seeds decide nothing
    other = next(r for r in stand["rows"] if r["estimator"] == "gnss-only")
    runs = [document("run", "pond.toml", "-e", "mine.py,gnss-only", "--seed", k)["estimators"] for k in range(3)]
    ratios = [mine["scores"]["horizontal_rmse"] / gnss["scores"]["horizontal_rmse"] for mine, gnss in runs]
    assert other["ratio"] == pytest.approx(np.exp(np.mean(np.log(ratios))))
    assert other["better"] == pytest.approx(np.mean(np.array(ratios) < 1.0))
    left = {p.name for p in here.iterdir()} - {"__pycache__"}
    assert left == {"mine.py", "pond.toml"}  # results are not left behind
    shown = call(*words).stdout
    assert "mine may be 1 to 2 of 2" in shown
    assert shown.strip().splitlines()[-1].startswith("mine may be 1 to 2 of 2 on pond-v1")


def test_evaluate_of_a_broken_estimator_is_a_failure(here):
    words = ["evaluate", "mine.py", "-s", "pond.toml", "-n", "2", "--against", "gnss-only", "--workers", "1"]
    result = call(*words, "--set", "choice=raise", code=1)
    assert "broken on purpose" in result.stdout
    assert "it refuses a scenario" in call(*words, "--set", "choice=refuse", code=1).stdout


def test_evaluate_leaves_out_what_does_not_suit_before_anything_runs(here, monkeypatch):
    """What an estimator of a file needs is known without a run."""
    (here / "blind.toml").write_text(
        re.sub(r'name = "pond"', 'name = "blind"', POND).replace(
            "gnss_position]\nsigma_m = [1.0, 1.0, 2.0]", "depth]\nsigma_m = 1.0"
        )
    )
    words = ["evaluate", "mine.py", "--against", "gnss-only", "-n", "2", "--workers", "1"]
    shown = call(*words, "-s", "blind.toml,pond.toml").stdout
    left_out = "mine cannot run on blind-v1, which is left out: it needs gnss_position; there is none."
    assert shown.strip().splitlines()[-1] == left_out
    assert "blind-v1" not in shown.replace(left_out, "")

    monkeypatch.setattr("simnav.leaderboard.campaign.campaign.run_campaign", None)
    why = "it needs gnss_position; there is none; nothing was run"
    assert f"mine cannot run on blind-v1: {why}" in complaint_of(call(*words, "-s", "blind.toml", code=2))
    ours = call("evaluate", "gnss-only", "-s", "blind.toml", code=2)
    assert "gnss-only cannot run on blind-v1: it needs gnss_position or gnss_receiver" in complaint_of(ours)
    sweep = ["sweep", "blind.toml", "--dial", "duration_s=20,30", "-e", "mine.py"]
    assert f"mine cannot run on blind-v1: {why}" in complaint_of(call(*sweep, code=2))
    claim = ["paper", "claim", "mine.py", "--than", "gnss-only", "--gain", "5", "--scenario", "blind.toml"]
    assert f"mine cannot run on blind-v1: {why}" in complaint_of(call(*claim, code=2))
    unsuitable = call(*words, "-s", "pond.toml", "--set", "choice=unsuitable", code=2)
    assert "it needs terrain_fix; there is none; nothing was run" in complaint_of(unsuitable)


def complaint_of(result) -> str:
    return result.stderr.strip().splitlines()[-1]


def test_campaign_goes_on_where_it_was_and_the_board_follows(here):
    words = ["campaign", "-s", "pond.toml", "-e", "gnss-only,mine.py", "--no-oracle", "--workers", "1", "-o", "out"]
    first = document(*words, "--runs", "2")
    assert (first["asked"], first["computed"], first["runs"], first["failed"]) == (4, 4, 4, {})
    again = document(*words, "--runs", "3")
    assert (again["asked"], again["computed"], again["runs"]) == (6, 2, 6)
    assert [r["estimator"] for r in again["ranking"]["tracks"][0]["rows"]] == ["gnss-only", "mine"]

    board = document("leaderboard", "out", "--output", "board", "--workers", "1")
    assert Path(board["site"]) == here / "board" / "index.html"
    assert Path(board["site"]).is_file()
    assert board["ranking"] == again["ranking"]
    rows = json.loads((here / "board" / "results.json").read_text())["results"]
    assert len(rows) == board["runs"] == 6
    shown = call("leaderboard", "out", "--output", "board", "--workers", "1").stdout
    assert "Other scenarios: 1 scenario, 3 seeds, provisional" in shown
    assert str(here / "board" / "index.html") in shown.replace("\n", "")


def test_campaign_reports_failures_and_succeeds(here):
    found = document(
        "campaign",
        "-s",
        "pond.toml",
        "-e",
        "gnss-only,mine.py:choice=raise",
        "--no-oracle",
        "--workers",
        "1",
        "-n",
        "2",
    )
    assert found["failed"] == {"error": 2}
    assert Path(found["results"]) == here / "results"


# -- the console ---------------------------------------------------------------------------------------------


def test_warmup_counts_kernels():
    from simnav.compiled import kernels

    assert document("warmup")["kernels"] == len(kernels()) > 0


def entry(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The command as the console script starts it, in a process of its own."""
    code = "import sys; from simnav.leaderboard.cli import main; sys.argv[0] = 'simnav'; main()"
    # No -c: like a console script, it does not search the working directory; PYTHONPATH with an empty entry does.
    script = cwd.parent / "simnav-script.py"
    script.write_text(code)
    root = str(Path(cli.__file__).resolve().parents[2])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([root, ""])}
    return subprocess.run([sys.executable, script, *words], cwd=cwd, capture_output=True, text=True, env=environment)


def test_folders_of_the_same_names_do_no_harm(tmp_path):
    cwd = tmp_path / "work"
    for name in ("estimators", "scenarios", "simnav_extra"):
        (cwd / name).mkdir(parents=True)
        (cwd / name / "__init__.py").write_text(f"raise RuntimeError('the wrong {name}')")
    (cwd / "pond.toml").write_text(SCENARIO)
    run = entry("list", "--json", cwd=cwd)
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    found = json.loads(run.stdout)
    assert found["scenarios"]
    assert found["estimators"]
    run = entry(
        "campaign", "-s", "pond.toml", "-e", "gnss-only", "--no-oracle", "-n", "2", "--workers", "2", "--json", cwd=cwd
    )
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["failed"] == {}


def test_the_parser_too_answers_with_one_sentence(tmp_path):
    for words, says in (
        (["lsit"], "list"),
        (["run"], "SCENARIO"),
        (["run", "open-sea", "--seed", "-1"], "seed"),
        (["list", "everything"], "'topic': 'everything' is not one of 'scenarios'"),
    ):
        run = entry(*words, cwd=tmp_path)
        assert run.returncode == 2
        assert run.stdout == ""
        assert len(run.stderr.strip().splitlines()) == 1
        assert says in run.stderr
    run = entry("run", "open-sea", "--seed", "-1", "--json", cwd=tmp_path)
    assert json.loads(run.stdout)["code"] == run.returncode == 2
