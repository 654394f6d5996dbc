"""Everything that the command does is one Python call: both are run, and must say the same."""

from __future__ import annotations

import inspect
import json
import subprocess
import sys
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

import simnav
from simnav import Estimate, Estimator
from simnav.estimator import registry
from simnav.leaderboard import requests
from simnav.leaderboard.cli import app
from simnav.leaderboard.cli.commands import COMMANDS, GROUPS
from simnav.leaderboard.cli.derived import command as derived_command
from simnav.leaderboard.cli.derived import requested
from simnav.leaderboard.cli.new_estimator import write_estimator
from simnav.leaderboard.interface import results_of, scenario_of
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.plain import as_json
from simnav.recording import Recording
from simnav.warmup import warmup
from tests.cases import POND


class LastFix(Estimator):
    """Keeps a share of the last fix."""

    def __init__(self, gain: float = 1.0):
        self.gain = gain

    def reset(self, start, instruments):
        self.position = start.position.copy()

    def update(self, measurements):
        for m in (m for m in measurements if m.kind == "gnss_position"):
            self.position = self.position + self.gain * (m.value - self.position)
        return Estimate(measurements.time, self.position.copy())


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clean_registry: None) -> Path:
    """A working directory with a short scenario; what a test registers is forgotten."""
    (tmp_path / "pond.toml").write_text(POND)
    monkeypatch.chdir(tmp_path)
    return tmp_path


#: What depends on the moment, not on what was asked for.
_TIMES = {"seconds", "simulation_seconds", "update_median", "update_mean", "update_p95", "peak_memory", "memory_growth",
          "plot", "computed", "site", "generated"}  # fmt: skip


def timeless(value: Any) -> Any:
    if isinstance(value, dict):
        multiple = {"value", "low", "high"} if {"plain", "rounds", "scenario"} <= value.keys() else set()
        return {k: timeless(v) for k, v in value.items() if k not in _TIMES | multiple}
    return [timeless(v) for v in value] if isinstance(value, list) else value


def command(*words: str) -> Any:
    result = CliRunner().invoke(app, [*words, "--json"])
    assert result.exit_code == 0, result.stderr
    return timeless(json.loads(result.stdout))


def call_list() -> Any:
    from simnav.scenario.catalogue import headers

    return {"estimators": simnav.names(), "scenarios": sorted(h.id for h in headers())}


def call_simulate() -> Any:
    recording = simnav.record("pond.toml", 4)
    recording.save(Path("mine.npz"))
    theirs = Recording.load(Path("theirs.npz"))
    for name, stream in recording.data.aids.items():
        np.testing.assert_array_equal(stream.value, theirs.data.aids[name].value)
    return {"measurements": {name: len(stream) for name, stream in recording.data.aids.items()}, "seed": 4}


def call_leaderboard() -> Any:
    simnav.campaign("pond.toml", "gnss-only,ship-ekf", runs=2, output="out", workers=1, oracle=False)
    made = simnav.site("out", output="mine", workers=1)
    assert made.index == Path("mine/index.html").resolve()
    assert json.loads(made.index.with_name("results.json").read_text())["results"]
    assert len(results_of("out")) == 4
    assert made.to_dict()["runs"] == sum(r.tried for r in results_of("out"))
    return made.to_dict()


RATE = "instruments.gnss_position.rate_hz"

CALLS: dict[str, tuple[list[str], Callable[[], Any]]] = {
    "list": (["list"], call_list),
    "run": (
        ["run", "pond.toml", "-e", "gnss-only:acceleration=0.5,ship-ekf", "--seed", "3"],
        lambda: simnav.run("pond.toml", ["gnss-only:acceleration=0.5", "ship-ekf"], seed=3).to_dict(),
    ),
    "simulate": (["simulate", "pond.toml", "-o", "theirs.npz", "--seed", "4"], call_simulate),
    "check": (["check", "gnss-only:acceleration=0.5"], lambda: simnav.check("gnss-only:acceleration=0.5").to_dict()),
    "bench": (
        ["bench", "gnss-only:acceleration=0.5", "--against", "ship-ekf", "-s", "pond.toml", "--epochs", "20",
         "--rounds", "1", "--seed", "3"],
        lambda: simnav.bench(
            "gnss-only:acceleration=0.5", against="ship-ekf", scenario="pond.toml", seed=3, epochs=20, rounds=1
        ).to_dict(),
    ),
    "new-estimator": (["new-estimator", "theirs"], lambda: {"name": write_estimator("mine")[0]}),
    "evaluate": (
        ["evaluate", "gnss-only:acceleration=0.5", "gnss-only:acceleration=2", "-s", "pond.toml", "-n", "3",
         "--against", "ship-ekf", "--workers", "1"],
        lambda: simnav.evaluate(
            [("gnss-only", {"acceleration": "0.5"}), "gnss-only:acceleration=2"], "pond.toml", runs=3,
            against="ship-ekf", workers=1,
        ).to_dict(),
    ),
    "campaign": (
        ["campaign", "-s", "pond.toml", "-e", "gnss-only,ship-ekf", "-n", "2", "-o", "out", "--no-oracle",
         "--workers", "1"],
        lambda: simnav.campaign(
            "pond.toml", "gnss-only,ship-ekf", runs=2, output="out", workers=1, oracle=False
        ).to_dict(),
    ),
    "leaderboard": (["leaderboard", "out", "-o", "theirs", "--workers", "1"], call_leaderboard),
    "bound": (
        ["bound", "open-sea", "-n", "1"],
        lambda: {**simnav.bound("open-sea", runs=1).to_dict(), "csv": None},
    ),
    "log allan": (
        ["log", "allan", "open-sea", "--duration", "100", "--seed", "2"],
        lambda: {**simnav.allan("open-sea", duration=100.0, seed=2).to_dict(), "plot": None, "csv": None},
    ),
    "campaign cite": (["campaign", "cite"], lambda: simnav.cite().to_dict()),
    "sweep": (
        ["sweep", "pond.toml", "--dial", RATE + "=1,2", "-e", "gnss-only", "-n", "1", "--workers", "1", "-o", "swept"],
        lambda: simnav.sweep("pond.toml", {RATE: [1, 2]}, "gnss-only", runs=1, output="swept", workers=1).to_dict(),
    ),
    "warmup": (["warmup"], lambda: {"kernels": len(__import__("simnav.compiled").compiled.kernels())}),
}  # fmt: skip

#: Commands whose calls are compared where their own tests are: they take minutes, or need what another one makes.
ELSEWHERE = {"campaign merge", "campaign rescore", "campaign seal", "campaign verify", "robustness", "submit", "tune"}
ELSEWHERE |= {
    "log inspect",
    "log realism",
    "log align",
    "log tune-noise",
    "log identify",
    "log twin",
    "log recordings",
    "export",
    "score",
}
ELSEWHERE |= {"paper claim", "paper reproduce", "paper train-anfis", "show", "dataset", "recommend"}
ELSEWHERE |= {f"standard {name}" for name in ("run", "check", "audit", "draw", "publish", "reference")}


def commands() -> dict[str, Callable[..., Any]]:
    """Every command with what it runs, those of groups by both words, and groups that are commands."""
    found = {name: derived_command(*COMMANDS[name]) for name in COMMANDS.keys() & GROUPS.keys()}
    groups = [("", app)] + [(f"{g.name} ", g.typer_instance) for g in app.registered_groups]
    for prefix, group in groups:
        for c in group.registered_commands:
            assert c.callback is not None
            found[prefix + (c.name or c.callback.__name__)] = c.callback
    return found


@pytest.mark.parametrize("name", CALLS)
def test_a_command_and_its_call_say_the_same(here: Path, name: str) -> None:
    words, call = CALLS[name]
    if name == "leaderboard":
        called = timeless(as_json(call()))
        said = command(*words)
    else:
        said = command(*words)
        called = timeless(as_json(call()))
    if name == "list":
        said = {
            "estimators": [e["name"] for e in said["estimators"]],
            "scenarios": sorted(s["id"] for s in said["scenarios"]),
        }
    if name == "new-estimator":
        assert said.pop("name") == "theirs"
        assert called.pop("name") == "mine"
        texts = [Path(f"{n}.py").read_text().lower().replace(n, "") for n in ("mine", "theirs")]
        assert texts[0] == texts[1]
    assert {k: said[k] for k in called} == called
    more = {"file", "figure", "csv", "scenario", "duration", "imu_samples", "failed", "confinement"}
    more |= {"correlations", "voyages"}
    assert set(said) - set(called) <= more


def test_every_command_is_compared() -> None:
    assert set(commands()) == set(CALLS) | ELSEWHERE


#: The call of a command, where its name is another one; None where the maintainers of simnav alone need it, or where
#: Python has the objects themselves (``show``).
OTHER_NAMES: dict[str, Callable[..., Any] | None] = {
    "list": simnav.names, "simulate": simnav.record, "leaderboard": simnav.site, "new-estimator": write_estimator,
    "warmup": warmup, "standard reference": None, "show": None, "paper train-anfis": None,
    "standard run": simnav.run_standard, "standard draw": simnav.draw_standard,
    "standard check": simnav.check_standard, "standard audit": simnav.audit_standard,
    "standard publish": simnav.publish_standard, "log inspect": simnav.inspect_log, "score": simnav.score_files,
    "log tune-noise": simnav.tune_noise,
}  # fmt: skip

#: Options that are no argument of the call: what is done with the object that it returns, and files that it writes.
OF_THE_RESULT = {
    "list": {"topic"},
    "run": {"plot", "plot_lags", "stanford", "alert_limit", "animate"},
    "simulate": {"output", "csv"},
    "score": {"plot"},
    "sweep": {"plot"},
    "robustness": {"plot"},
    "paper claim": {"plot"},
    "log identify": {"plot", "output"},
    "bench": {"every", "output"},  # of all rows: simnav.costs
    "bound": {"csv"},
    "log align": {"plot"},
    "log inspect": {"plot"},
    "log allan": {"plot", "csv"},
    "log realism": {"plot", "fit"},
    "campaign verify": {"present", "tolerance"},  # of a bundle: simnav.verify_bundle
    "campaign cite": {"text"},
    "tune": {"output", "plot", "parameters"},  # parameters that are held are a pair with the estimator
}


def arguments(function: Callable[..., Any], *, without: Collection[str] = ()) -> set[str]:
    """Names of the arguments."""
    return {*inspect.signature(function).parameters} - {*without}


@pytest.mark.parametrize("name", commands())
def test_every_option_is_an_argument_of_the_call_and_the_other_way_round(name: str) -> None:
    call = OTHER_NAMES[name] if name in OTHER_NAMES else getattr(simnav, name.split()[-1])
    if call is None:
        return
    options = arguments(commands()[name], without={"json", "debug", *OF_THE_RESULT.get(name, ())})
    assert options == arguments(call, without={"progress", "load", "processes", "by_version", "everything"})


@pytest.mark.parametrize("name", ["campaign", "evaluate", "sweep", "site", "verify"])
def test_a_call_shows_its_options(name: str) -> None:
    """The request is the one place: signature, documentation and defaults of the call come from it."""
    call = getattr(simnav, name)
    request = inspect.signature(call.of).parameters["request"].annotation
    declared = call.of.__globals__[request].__dataclass_fields__
    shown = inspect.signature(call).parameters
    assert {*shown} == {*declared}
    text = inspect.getdoc(call) or ""
    for option, field in declared.items():
        assert f"\n{option} : " in text
        assert shown[option].default in (field.default, inspect.Parameter.empty)
    assert "\nReturns\n-------\n" in text
    with pytest.raises(TypeError, match=rf"^{name}\(\) got an unexpected keyword argument 'nothing'"):
        call(*["x" for p in shown.values() if p.default is p.empty], nothing=1)


def test_an_option_is_read_as_it_was_declared() -> None:
    given = {
        "scenarios": ["a"], "estimators": None, "force": ["ekf"], "shard": "2/3", "parameters": ["gate=3"],
        "methods": None,
    }  # fmt: skip
    fields = requests.CampaignRequest.__dataclass_fields__
    values = {n: f.default for n, f in fields.items()} | given
    read = requested(requests.CampaignRequest, values)
    assert (read.scenarios, read.force, read.shard, read.parameters) == (["a"], ("ekf",), (2, 3), {"gate": "3"})
    with pytest.raises(simnav.RequestError, match="--set gate: it should be name=value"):
        requested(requests.CampaignRequest, values | {"parameters": ["gate"]})


# -- what may be given, and what comes back ------------------------------------------------------------------


def test_names_load_with_their_first_use() -> None:
    code = (
        "import sys, simnav\n"
        "assert not {m for m in sys.modules if m.startswith('simnav.leaderboard')}\n"
        "assert not {'numba', 'gtsam', 'matplotlib', 'pyarrow', 'scipy', 'pydantic', 'typer'} & set(sys.modules)\n"
        "assert set(simnav.__all__) <= set(dir(simnav))\n"
        "simnav.run, simnav.check, simnav.load\n"
        "assert not {'gtsam', 'matplotlib', 'pyarrow', 'scipy', 'typer'} & set(sys.modules)\n"
        "import simnav.testing.contract_check\n"
        "assert callable(simnav.check)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.usefixtures("here")
def test_numbers_of_numpy_and_generators_are_taken() -> None:
    report = simnav.run("pond.toml", (name for name in ("gnss-only", LastFix)), seed=np.int64(3))
    assert [e.estimator for e in report.estimators] == ["gnss-only", "last-fix"]
    assert type(report.recording.seed) is int


def test_every_public_name_is_there() -> None:
    for name in simnav.__all__:
        assert getattr(simnav, name) is not None


def test_python_m_simnav(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-m", "simnav", "--version"], cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout.startswith("simnav 0.")


def test_one_estimator_given_in_four_ways(here: Path) -> None:
    source = inspect.getsource(LastFix)
    (here / "last_fix.py").write_text(f"from simnav import Estimate, Estimator\n\n\n{source}")
    half = {"gain": 0.5}
    ways: list[Any] = [
        "last_fix.py:gain=0.5",
        ("last_fix.py:LastFix", half),
        (Path("last_fix.py"), half),
    ]

    def rmse(report: Any) -> float:
        return float(report.estimators[0].scores["horizontal_rmse"])

    found = [rmse(simnav.run("pond.toml", way)) for way in ways]
    found.append(rmse(simnav.run(simnav.load("pond.toml"), "last_fix.py", parameters=half)))
    assert len(set(found)) == 1
    registry.forget(here / "last_fix.py")
    report = simnav.run("pond.toml", [(LastFix, half), LastFix])
    assert rmse(report) == found[0] != report.estimators[1].scores["horizontal_rmse"]
    assert [e.estimator for e in report.estimators] == ["last-fix(gain=0.5)", "last-fix"]
    assert isinstance(simnav.make(LastFix, gain=0.25), LastFix)
    assert simnav.check(LastFix, gain=0.5).passed


@pytest.mark.usefixtures("here")
def test_what_comes_back_is_a_frame_and_a_figure() -> None:
    two = "gnss-only,gnss-only:acceleration=2"
    run = simnav.run("pond.toml", two)
    evaluation = simnav.evaluate("gnss-only", "pond.toml", runs=2, against=two, workers=1, results="kept")
    bound = simnav.bound("open-sea", runs=1)
    costs = simnav.bench("gnss-only", against="ship-ekf", scenario="pond.toml", epochs=20, rounds=1)
    assert evaluation.folder is not None
    ranking = simnav.rank(evaluation.folder)
    for report, rows in ((run, 2), (evaluation, 4), (ranking, 2), (costs, 2), (bound, len(bound.time))):
        table = report.to_frame()
        assert len(table) == rows
        assert isinstance(report.plot(), Figure)
    scores = run.to_frame()["horizontal_rmse"]
    assert [float(str(v)) for v in scores] == [e.scores["horizontal_rmse"] for e in run.estimators]


def test_frames_without_pandas_are_arrow_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [{"a": 1, "b": "x"}, {"a": 2, "b": "y"}]
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert frame(rows).to_pydict() == {"a": [1, 2], "b": ["x", "y"]}

    class Pandas:
        DataFrame = staticmethod(lambda columns: ("frame", columns))

    monkeypatch.setitem(sys.modules, "pandas", Pandas)  # type: ignore[arg-type]
    assert frame(rows) == ("frame", {"a": [1, 2], "b": ["x", "y"]})


class Unfinished(Estimator):
    """Has no update."""

    def reset(self, start, instruments):
        pass


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: simnav.run("open-see", "ekf"), "did you mean 'open-sea'"),
        (lambda: simnav.run("pond.toml", "efk"), "did you mean 'ekf'"),
        (lambda: simnav.run("pond.toml", int), "int is no estimator"),
        (lambda: simnav.run("pond.toml", Unfinished), "lacks update"),
        (lambda: simnav.run("pond.toml", [3]), "3 is no estimator"),
        (lambda: simnav.run("pond.toml", 3), "3 is no estimator"),
        (lambda: simnav.run("pond.toml", LastFix()), "an object of LastFix was given; its class is wanted"),
        (lambda: simnav.run("pond.toml", {"gnss-only": {"acceleration": 1}}), "a list of pairs"),
        (lambda: simnav.run("pond.toml", []), "the list of estimators is empty"),
        (lambda: simnav.run("pond.toml", "gnss-only", parameters=[1]), "a mapping is wanted"),
        (lambda: simnav.run("pond.toml", "gnss-only", seed=1.5), "seed = 1.5: a whole number"),
        (lambda: simnav.run(None, "gnss-only"), "None is no scenario"),
        (lambda: simnav.run(["pond.toml"], "gnss-only"), "is no scenario"),
        (lambda: simnav.record("pond.toml", -1), "seed = -1"),
        (lambda: simnav.make("ekf", gait=3), "has no parameter 'gait'"),
        (lambda: simnav.make(("ekf", 3)), "it is a pair"),
        (lambda: simnav.make(("ekf", {}, 3)), "it is a pair"),
        (lambda: simnav.check("efk"), "did you mean 'ekf'"),
        (lambda: simnav.evaluate("gnss-only", "pond.toml", runs=0, against="ship-ekf"), "runs = 0"),
        (lambda: simnav.evaluate("gnss-only", [], against="ship-ekf"), "the list of scenarios is empty"),
        (lambda: simnav.evaluate("gnss-only", " ", against="ship-ekf"), "' ' names no scenario"),
        (lambda: simnav.evaluate("gnss-only", "pond.toml", workers=1.5), "workers = 1.5"),
        (lambda: simnav.evaluate("gnss-only", "pond.toml", time_limit="3"), "time_limit = '3'"),
        (lambda: simnav.evaluate("gnss-only", "pond.toml", memory_limit=None), "memory_limit = None"),
        (lambda: simnav.campaign("pond.toml", "gnss-only", runs=0), "runs = 0"),
        (lambda: simnav.campaign("pond.toml", "gnss-only", runs=1, minutes="3"), "minutes = '3'"),
        (lambda: simnav.campaign("pond.toml", "gnss-only", runs=1, output=""), "the path of a file or folder is empty"),
        (lambda: simnav.campaign("pond.toml", "gnss-only", runs=1, output="o", shard=1), "should be a pair"),
        (lambda: simnav.rank("nowhere", score="horizontal_rmze"), "did you mean 'horizontal_rmse'"),
        (lambda: simnav.rank("nowhere", score="availability"), "not better when lower"),
        (lambda: simnav.rank(None), "None is no path"),
        (lambda: simnav.rank(["out"]), "a folder of results is wanted"),
        (lambda: simnav.sweep("pond.toml", None, "gnss-only"), "dials = None"),
        (lambda: simnav.sweep("pond.toml", {RATE: ["a", 1]}, "gnss-only"), "should be a list of numbers"),
        (lambda: simnav.bound("open-sea", runs=1.5), "runs = 1.5"),
        (lambda: simnav.reproduce("mao-2025", runs=-1), "runs = -1"),
        (lambda: simnav.reproduce("mao-2025", methods="nobody"), "has no method 'nobody'"),
        (lambda: simnav.merge([], "m"), "no folder was named"),
        (lambda: simnav.site("nowhere"), "there are no results in"),
        (lambda: simnav.run("pond.toml", "ekf", parameters={"nothing": 1}), "no parameter 'nothing'"),
        (lambda: simnav.run("pond.toml", "ekf,ukf", parameters={"nothing": 1}), "nothing: none of the estimators"),
        (lambda: simnav.make("ekf,ukf"), "names 2 estimators"),
        (lambda: simnav.bench("nobody.py"), "nobody.py"),
        (lambda: simnav.bench([]), "no estimator was asked for"),
        (lambda: simnav.bench("gnss-only", scenario="pond.toml", epochs=1), "at least 2 are wanted"),
        (lambda: simnav.evaluate([], "pond.toml"), "no estimator was asked for"),
        (lambda: simnav.evaluate("nobody.py", "pond.toml", runs=2, against="gnss-only"), "nobody.py"),
        (lambda: simnav.campaign("pond.toml", "gnss-only", runs=1, output="."), "other files"),
        (lambda: simnav.rank("nowhere"), "there are no results in"),
        (lambda: simnav.bound("car-kitti"), "car-kitti"),
        (lambda: simnav.reproduce("999"), "there is no paper '999'"),
        (lambda: simnav.reproduce("mao-2025", methods=["nobody"]), "has no method 'nobody'"),
    ],
)
@pytest.mark.usefixtures("here")
def test_what_cannot_be_done_is_one_sentence(call: Callable[[], Any], says: str) -> None:
    with pytest.raises(simnav.RequestError, match=says) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_a_scenario_is_taken_as_it_is(here: Path) -> None:
    scenario = simnav.load("pond.toml")
    assert scenario_of(scenario) is scenario
    assert len(simnav.record(scenario).data.truth) == len(simnav.record("pond.toml", seed=0).data.truth) == 30
    assert scenario_of(here / "pond.toml") == scenario


@pytest.mark.usefixtures("here")
def test_a_class_takes_part_in_a_campaign_of_several_workers() -> None:
    report = simnav.evaluate((LastFix, {"gain": 0.5}), "pond.toml", runs=3, against=["gnss-only", LastFix], workers=2)
    assert report.estimators == ("last-fix(gain=0.5)",)
    assert {r.estimator for r in report.results} == {"last-fix(gain=0.5)", "last-fix", "gnss-only"}
    assert all(r.status == "ok" for r in report.results), report.results
    (stand,) = report.standings
    assert stand.of == 3
