"""A submission holds where it is repeated, and one that was tampered with does not."""

from __future__ import annotations

import hashlib
import json
import shutil
import stat
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard import publishing
from simnav.leaderboard.campaign import fingerprint
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.provenance import Provenance
from simnav.leaderboard.submission import archive, environment, source, verifying
from simnav.leaderboard.submission.bundle import open_bundle
from simnav.leaderboard.submission.repetition import Again, Asked, answer
from simnav.simulation.version import SIMULATOR_VERSION
from tests.cases.packages import install
from tests.hostile.forging import evil_scenario, fields, forge

PROFILE = """
title = "two short voyages"
[[part]]
scenarios = ["clean-voyages"]
runs = 2
"""

MINE = """
import json
from pathlib import Path
from simnav import Estimate, Estimator, register
from helper import last

GAIN = json.loads(Path(__file__).with_name("gain.json").read_text())["gain"]

@register("my-last-fix")
class MyLastFix(Estimator):
    '''The last fix.'''

    def __init__(self, gain: float = 1.0):
        self.gain = gain * GAIN

    def reset(self, start, instruments):
        self.position = start.position
        witness = Path(__file__).parents[1] / "witness"
        try:
            witness.write_text("it was written outside")
        except OSError:
            pass

    def update(self, measurements):
        self.position = self.position + self.gain * (last(measurements, self.position) - self.position)
        return Estimate(measurements.time, position=self.position)
"""

HELPER = """
def last(measurements, otherwise):
    fix = measurements.latest("gnss_position")
    return otherwise if fix is None else fix.value
"""


def written(folder: Path, *, package: str = "") -> Path:
    """The estimator as a file with what it needs, or as an installed package."""
    beside = {"helper.py": HELPER, "gain.json": '{"gain": 0.5}'}
    if package:
        rows = MINE.replace("from helper", "from .helper").replace("my-last-fix", "packed-fix")
        files = {"__init__.py": "", "rows.py": rows, **beside}
        points = {"simnav.estimators": {"rows": f"{package}.rows"}}
        install(folder, package, points, {f"{package}/{name}": text for name, text in files.items()})
        return folder
    folder.mkdir(parents=True)
    for name, text in {"my_last_fix.py": MINE, **beside}.items():
        (folder / name).write_text(text)
    return folder / "my_last_fix.py"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle of a file; its source is gone."""
    home = tmp_path_factory.mktemp("submission")
    (home / "short.toml").write_text(PROFILE)
    mine = written(home / "mine")
    done = publishing.submit(f"{mine}:MyLastFix:gain=0.9", profile=home / "short.toml", output=home / "made.zip",
                             results=home / "results", workers=1)  # fmt: skip
    assert (done.results, done.failed, done.profile) == (2, 0, "short")
    assert done.digest == hashlib.sha256(done.path.read_bytes()).hexdigest()
    shutil.rmtree(home / "mine")
    shutil.rmtree(home / "results")
    return done.path


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs are repeated in this process: another one takes seconds to start."""

    def repeated(python: Path, asked: Asked, *_: object) -> tuple[list[Again], Provenance]:
        told = answer(Asked.read(asked.text()), lambda *_: None)
        return [Again(**run) for run in told["runs"]], Provenance.from_dict(told["provenance"])

    monkeypatch.setattr(verifying, "repeat", repeated)


def test_a_bundle_holds_what_is_needed_and_no_more(made: Path, tmp_path: Path) -> None:
    bundle = open_bundle(made, tmp_path)
    assert sorted(p.name for p in (tmp_path / "source").iterdir()) == ["gain.json", "helper.py", "my_last_fix.py"]
    (row,) = bundle.contents.estimators
    assert (row.label, row.name) == ("my-last-fix(gain=0.9)", "my_last_fix.py:MyLastFix")
    assert row.parameters == {"gain": "0.9"}
    assert bundle.contents.runs == {"clean-voyages-v1": 2}
    results = store.load(bundle.results)
    assert [r.seed for r in results] == [0, 1]
    assert not any(r.series for r in results)
    assert all(r.provenance.numpy and r.provenance.confinement != "none" for r in results)


def test_it_holds_to_the_bit_and_on_sealed_seeds_and_runs_confined(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verifying, "_SEALED_RUNS", 2)  # each starts a server
    key = tmp_path / "key"
    key.write_text("8f3c5a0e7d19b264c1f07ae9365bd482")
    key.chmod(0o600)
    done = CliRunner().invoke(app, ["campaign", "verify", str(made), "--present", "--key", str(key), "--json"])
    told = json.loads(done.stdout)
    assert (done.exit_code, told["findings"], told["different"]) == (0, [], [])
    assert (told["repeated"], told["identical"], told["close"], told["passed"]) == (2, 2, 0, True)
    (sealed,) = told["sealed"]
    assert (sealed["sealed"], sealed["failed"]) == (2, 0)
    assert 0.2 < sealed["ratio"] < 5.0
    assert sealed["p_value"] > 0.01
    assert "numpy" in told["environment"]
    assert not list(tmp_path.parent.glob("**/witness"))


def test_a_package_travels_as_a_wheel_and_is_never_imported_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clean_registry: None, request: pytest.FixtureRequest
) -> None:
    from simnav.estimator import registry

    folder = written(tmp_path / "site", package="simnav_packed_fix")
    monkeypatch.syspath_prepend(str(folder))
    registry.discover_point("simnav_packed_fix.rows")
    (tmp_path / "short.toml").write_text(PROFILE.replace("runs = 2", "runs = 1"))
    done = publishing.submit("simnav-packed-fix", profile=tmp_path / "short.toml", output=tmp_path / "made.zip",
                             results=tmp_path / "results", workers=1)  # fmt: skip
    assert done.estimators == ("packed-fix",)
    shutil.rmtree(folder)
    monkeypatch.undo()
    for name in [n for n in sys.modules if n.startswith("simnav_packed_fix")]:
        del sys.modules[name]
    request.getfixturevalue("here")
    told = publishing.verify_bundle(done.path, present=True)
    assert told.passed, told
    assert (told.identical, told.title) == (1, "simnav_packed_fix")
    assert not [n for n in sys.modules if n.startswith("simnav_packed_fix")]


def test_a_bundle_is_merged_like_a_folder_of_results(made: Path, tmp_path: Path) -> None:
    merged = simnav.merge([made], tmp_path / "out")
    assert [(r.estimator, r.seed) for r in merged] == [("my-last-fix(gain=0.9)", k) for k in range(2)]
    bad = changed(made, tmp_path / "bad.zip", better_source, hashes=False)
    with pytest.raises(RequestError, match="was changed"):
        simnav.merge([bad], tmp_path / "other")


# -- tampering ---------------------------------------------------------------------------------------------------


def changed(made: Path, target: Path, change: Callable[[Path], None], *, hashes: bool) -> Path:
    """The bundle after a change of its files, with its old hashes or with those of the new content."""
    folder = target.with_suffix("")
    with zipfile.ZipFile(made) as before:
        before.extractall(folder)
    change(folder)
    manifest = folder / "bundle.json"
    if hashes:
        told = json.loads(manifest.read_text())
        files = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file() and p != manifest}
        told["files"] = {n: {"sha256": archive.digest_of(p), "size": p.stat().st_size} for n, p in files.items()}
        manifest.write_text(json.dumps(told))
    with zipfile.ZipFile(target, "w") as after:
        for path in sorted(p for p in folder.rglob("*") if p.is_file()):
            after.write(path, path.relative_to(folder).as_posix())
    return target


Scores = list[tuple[str, float]]


def with_scores(folder: Path, change: Callable[[Scores], Scores]) -> None:
    (part,) = folder.glob("results/compacted/*.parquet")
    table = pq.read_table(part)
    at = table.schema.get_field_index("scores")
    scores = pa.array([change(row) for row in table["scores"].to_pylist()], table.schema.field(at).type)
    pq.write_table(table.set_column(at, "scores", scores), part)


def with_runs(folder: Path, count: int) -> None:
    manifest = folder / "bundle.json"
    told = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(told | {"runs": {"short-v1": count}}))


def better_result(folder: Path) -> None:
    with_scores(folder, lambda row: [(k, 0.9 * v if k == "horizontal_rmse" else v) for k, v in row])


def without_a_score(folder: Path) -> None:
    with_scores(folder, lambda row: [(k, v) for k, v in row if k != "r95"])


def with_the_score_of_a_plug_in(folder: Path) -> None:
    with_scores(folder, lambda row: [*row, ("my_score", 1.5)])


def better_source(folder: Path) -> None:
    (folder / "source" / "gain.json").write_text('{"gain": 0.55}')


def without_the_worst(folder: Path) -> None:
    (part,) = folder.glob("results/compacted/*.parquet")
    pq.write_table(pq.read_table(part).slice(0, 1), part)


@pytest.mark.parametrize(
    ("change", "hashes", "said"),
    [
        (better_result, False, r"results/compacted/.*parquet was changed: its hash is not that of bundle.json"),
        (better_source, False, "source/gain.json was changed: its hash is not"),
        (lambda f: (f / "source" / "more.py").write_text("1"), False, "source/more.py does not belong to it"),
        (lambda f: (f / "source" / "helper.py").unlink(), False, "source/helper.py is missing"),
        (lambda f: (f / "setup.py").write_text("1"), True, "setup.py does not belong to it"),
        (lambda f: (f / "bundle.json").write_text("{"), False, "bundle.json is no JSON"),
        (lambda f: (f / "bundle.json").write_text('{"format": 9}'), False, "has format 9"),
        (lambda f: (f / "bundle.json").write_text('{"format": 1}'), False, "bundle.json: title: Field required"),
        (lambda f: with_runs(f, 10**12), False, "runs.short-v1: Input should be less than or equal to 1000000"),
        (lambda f: with_runs(f, 0), False, "runs.short-v1: Input should be greater than or equal to 1"),
        (lambda f: (f / "bundle.json").unlink(), False, "bundle.json is missing; 'simnav submit' makes one"),
    ],
)  # fmt: skip
def test_a_changed_file_is_named(
    made: Path, tmp_path: Path, change: Callable[[Path], None], hashes: bool, said: str
) -> None:
    with pytest.raises(RequestError, match=said):
        open_bundle(changed(made, tmp_path / "bad.zip", change, hashes=hashes), tmp_path / "open")


def worse_and_fewer(folder: Path) -> None:
    better_result(folder)
    without_the_worst(folder)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (worse_and_fewer, ("1 runs are missing, such as seed 1", "horizontal_rmse is", "relative difference 0.1)")),
        (better_source, ("the results were not made with this source",)),
        (without_a_score, ("my-last-fix(gain=0.9) on clean-voyages-v1, seed 0: the results lack r95",)),
    ],
)
@pytest.mark.usefixtures("here")
def test_a_change_that_renews_the_hashes_does_not_hold(
    made: Path, tmp_path: Path, change: Callable[[Path], None], said: tuple[str, ...]
) -> None:
    bad = changed(made, tmp_path / "bad.zip", change, hashes=True)
    done = CliRunner().invoke(app, ["campaign", "verify", str(bad), "--present"])
    assert done.exit_code == 1
    for text in said:
        assert text in " ".join(done.stdout.split())
    assert "the submission does not hold" in done.stdout


@pytest.mark.usefixtures("here")
def test_a_score_of_a_plug_in_that_is_not_here_is_named_and_left_out(made: Path, tmp_path: Path) -> None:
    bundle = changed(made, tmp_path / "own.zip", with_the_score_of_a_plug_in, hashes=True)
    done = CliRunner().invoke(app, ["campaign", "verify", str(bundle), "--present"])
    assert done.exit_code == 0, done.stdout
    assert "not known here: my_score" in done.stdout
    assert "2 of 2 repeated runs are the same to the bit" in done.stdout


def entry(name: str, *, mode: int = stat.S_IFREG | 0o644) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.external_attr = mode << 16
    return info


@pytest.mark.parametrize("name", ["../evil.py", "/etc/evil.py", "source/../../evil.py", "source\\evil.py", "C:evil.py"])
def test_a_name_that_leads_out_is_refused(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / "bad.zip", "w") as bad:
        bad.writestr(entry(name), "1")
    with pytest.raises(RequestError, match="leads out of the folder"):
        open_bundle(tmp_path / "bad.zip", tmp_path / "open")
    assert [p.name for p in tmp_path.iterdir()] == ["bad.zip"]


def test_links_doubles_and_floods_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bad = tmp_path / "bad.zip"

    def refused(said: str) -> None:
        with pytest.raises(RequestError, match=said):
            open_bundle(bad, tmp_path / "open")
        assert not (tmp_path / "open").exists()

    with zipfile.ZipFile(bad, "w") as file:
        file.writestr(entry("source/link", mode=stat.S_IFLNK | 0o777), "/etc/passwd")
    refused("is no plain file")
    with zipfile.ZipFile(bad, "w") as file:
        file.writestr(entry("source/a.py"), "1")
        file.writestr(entry("source/A.py"), "2")
    refused("source/A.py is in it twice")
    monkeypatch.setattr(archive, "MOST_BYTES", 1 << 20)
    with zipfile.ZipFile(bad, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(entry("source/zeros"), bytes(2 << 20), zipfile.ZIP_DEFLATED)
    assert bad.stat().st_size < 10_000
    refused("more than 1 MiB when they are unpacked")
    monkeypatch.setattr(archive, "MOST_FILES", 3)
    with zipfile.ZipFile(bad, "w") as file:
        for k in range(4):
            file.writestr(entry(f"source/{k}"), "1")
    refused("holds 4 files; at most 3")
    bad.write_bytes(b"no archive")
    refused("is no whole ZIP file")


def test_a_size_that_is_a_lie_is_noticed(made: Path, tmp_path: Path) -> None:
    """A member states a small size in both headers, and unpacks to more."""
    with zipfile.ZipFile(tmp_path / "bad.zip", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("source/zeros", bytes(100_000))
    data = (tmp_path / "bad.zip").read_bytes()
    (tmp_path / "bad.zip").write_bytes(data.replace((100_000).to_bytes(4, "little"), (7).to_bytes(4, "little")))
    with pytest.raises(RequestError, match=r"longer than|cannot be unpacked"):
        open_bundle(tmp_path / "bad.zip", tmp_path / "open")
    broken = bytearray(made.read_bytes())
    broken[len(broken) // 3] ^= 0xFF
    (tmp_path / "broken.zip").write_bytes(bytes(broken))
    with pytest.raises(RequestError):
        open_bundle(tmp_path / "broken.zip", tmp_path / "other")


def told(**changes: object) -> Callable[[Path], None]:
    """Other contents of ``bundle.json``."""

    def change(folder: Path) -> None:
        contents = json.loads((folder / "bundle.json").read_text())
        (folder / "bundle.json").write_text(json.dumps(contents | changes))

    return change


@pytest.mark.parametrize(
    ("requires", "said"),
    [
        ("evil @ file:///tmp/evil", "names an address"),
        ("evil@https://example.org/evil-1.0.tar.gz", "names an address"),
        ("evil[all] @ git+https://example.org/evil", "names an address"),
        ("./evil", "is no requirement of a package"),
        ("evil/", "is no requirement of a package"),
        ("/tmp/evil", "is no requirement of a package"),
        ("../evil", "is no requirement of a package"),
        ("file:///tmp/evil", "is no requirement of a package"),
        ("git+https://example.org/evil", "is no requirement of a package"),
        ("-r evil.txt", "is no requirement of a package"),
        ("--index-url=https://example.org", "is no requirement of a package"),
        ("evil --config-settings=x=y", "is no requirement of a package"),
        ("evil>=1 --hash=sha256:00", "is no requirement of a package"),
        ("evil; python_version > '3'", "has a marker"),
        ("evil-1.0.zip", "is no name of a package with versions"),
        ("evil-1.0-py3-none-any.whl", "is no name of a package with versions"),
        ("evil===../evil", "is no name of a package with versions"),
        ("evil\n-r other", "is no printable text"),
        ("\u0435vil", "is no printable text"),
        ("x" * 1000, "is no printable text of up to 200 characters"),
    ],
)
def test_a_requirement_is_a_name_with_versions(made: Path, tmp_path: Path, requires: str, said: str) -> None:
    bad = changed(made, tmp_path / "bad.zip", told(requires=[requires]), hashes=False)
    with pytest.raises(RequestError, match=said):
        open_bundle(bad, tmp_path / "open")
    with pytest.raises(RequestError, match=said):
        environment.install_requirements(Path(sys.executable), [requires], tmp_path / "packages")
    with pytest.raises(RequestError, match=said):
        source.source_of(str(written(tmp_path / "mine")), {}, tmp_path, (requires,))


def test_requirements_reach_pip_in_their_plain_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[list[str]] = []
    monkeypatch.setattr(environment, "_run", lambda command, *_: seen.append(list(command)) or "")
    environment.install_requirements(Path(sys.executable), ["Torch[cpu] >= 2.6 , < 3"], tmp_path / "packages")
    assert seen[-1][-1] == "Torch[cpu]<3,>=2.6"
    assert seen[-1][6:8] == ["--only-binary", ":all:"]


@pytest.mark.parametrize("scenario", ["../../evil.toml", "/tmp/evil.toml", "evil.toml", "a/b-v1", "clean-voyages"])
def test_a_bundle_names_scenarios_by_id_only(made: Path, tmp_path: Path, scenario: str) -> None:
    bad = changed(made, tmp_path / "bad.zip", told(runs={scenario: 1}), hashes=False)
    with pytest.raises(RequestError, match="is no versioned id of a scenario"):
        open_bundle(bad, tmp_path / "open")


@pytest.mark.usefixtures("here")
def test_the_code_of_a_scenario_in_a_bundle_is_not_run(made: Path, tmp_path: Path) -> None:
    path, witness = evil_scenario(tmp_path / "others")

    def change(folder: Path) -> None:
        forge(folder / "results", lambda r: replace(r, scenario=str(path)) if r.seed == 1 else r)

    bad = changed(made, tmp_path / "bad.zip", change, hashes=True)
    report = publishing.verify_bundle(bad, present=True)
    assert not witness.exists()
    assert not report.passed
    assert "is no versioned id, such as coastal-voyage-v1" in report.findings[0]
    with pytest.raises(RequestError):
        simnav.merge([bad], tmp_path / "merged")
    assert not witness.exists()


@pytest.mark.usefixtures("here")
def test_a_bundle_of_an_older_commit_holds(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """simnav's own code is known by declared versions; only the submitter's files are known by digests."""
    (result, *_) = store.load(open_bundle(made, tmp_path / "open").results)
    assert result.recording == f"simulator-{SIMULATOR_VERSION}"
    history = ["git", "-C", str(Path(simnav.__file__).resolve().parents[1]), "rev-list", "--max-count=20", "HEAD"]
    done = subprocess.run(history, capture_output=True, text=True, check=False)
    older = done.stdout.split()[-1] if done.returncode == 0 else ""

    def change(folder: Path) -> None:
        forge(
            folder / "results", fields(made_commit=older, made_dirty=False if older else None, simnav="0.1.0+of-then")
        )

    bundle = changed(made, tmp_path / "older.zip", change, hashes=True)
    monkeypatch.setattr(fingerprint, "folder_code", lambda *_: "another digest of simnav's code")
    report = publishing.verify_bundle(bundle, present=True)
    assert report.passed, (report.findings, report.different, report.undecided)
    assert (report.repeated, report.identical, report.different) == (2, 2, ())
    assert set(report.unconfirmed_fields) <= {"commit", "dirty"}
    assert ("commit" in report.unconfirmed_fields) == bool(older)
    assert report.summary.startswith("proven: ")


@pytest.mark.usefixtures("here")
def test_a_bundle_of_another_simulator_does_not_hold(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("simnav.leaderboard.campaign.campaign.SIMULATOR_VERSION", SIMULATOR_VERSION + 1)
    report = publishing.verify_bundle(made, present=True)
    assert not report.passed
    assert "the scenario or the simulator is not that of the results" in report.different[0]
    assert f"(simulator-{SIMULATOR_VERSION}); here is" in report.different[0]


@pytest.mark.usefixtures("here")
def test_a_version_that_the_bundle_excludes_is_refused(made: Path, tmp_path: Path) -> None:
    def change(folder: Path) -> None:
        manifest = json.loads((folder / "bundle.json").read_text())
        (folder / "bundle.json").write_text(json.dumps({**manifest, "requires": ["numpy<2"]}))

    report = publishing.verify_bundle(changed(made, tmp_path / "bad.zip", change, hashes=True), present=True)
    assert not report.passed
    assert any("is excluded by the requirement numpy<2" in text for text in report.findings)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"status": "no-recording", "scores": {}}, "no-recording is stored, ok came out"),
        ({"status": "unsuitable", "scores": {}}, "unsuitable is stored, ok came out"),
        ({"status": "timeout", "scores": {}}, "timeout is stored, ok came out"),
        ({"status": "timeout", "time_limit": 1e-3, "scores": {}}, "have other limits than 60 s"),
        ({"status": "skipped", "scores": {}}, "status = 'skipped' is none of"),
        ({"note": "recording 'dive 1'"}, "note "),
        ({"draws": {"duration_s": 1.0}}, "draws "),
        ({"score_update_median": 1e-9, "seconds": 1e-9}, "update_median 1e-09 s is stored"),
        ({"score_nees_horizontal": None}, "the results lack nees_horizontal"),
        ({"score_coverage_95": 1.0}, "coverage_95 is"),
        ({"made_numpy": "9.9.9"}, "its results were made with several versions of numpy"),
        ({"made_commit": "0" * 40}, "several versions of commit"),
        ({"scoring": "{}", "score_r95": None}, "the results lack r95"),
        ({"estimator_digest": "0" * 24}, "the results were not made with this source"),
        ({"reference": True}, "says that it was told the truth"),
    ],
)
@pytest.mark.usefixtures("here")
def test_the_worst_run_cannot_be_forged(made: Path, tmp_path: Path, changes: dict[str, object], said: str) -> None:
    def change(folder: Path) -> None:
        forge(folder / "results", lambda r: fields(**changes)(r) if r.seed == 1 else r)

    report = publishing.verify_bundle(changed(made, tmp_path / "bad.zip", change, hashes=True), present=True)
    assert not report.passed
    assert said in " | ".join((*report.findings, *report.different, *report.undecided))


def test_a_row_of_a_bundle_looks_like_no_other(made: Path, tmp_path: Path) -> None:
    for k, (label, said) in enumerate({
        "\u0435kf": "consists of printable ASCII", "EKF": "can be taken for ekf", "sw_fgo": "can be taken for sw-fgo",
        "ekf(window=3)": "is a name of one of simnav's own", "ekf:Mine": "is a name of one of simnav's own",
        "x" * 201: "at most 200", "a\nb": "consists of printable ASCII",
    }.items()):  # fmt: skip
        contents = {"estimators": [{"label": label, "name": "my_last_fix.py:MyLastFix"}]}
        bad = changed(made, tmp_path / f"bad-{k}.zip", told(**contents), hashes=False)
        with pytest.raises(RequestError, match=said):
            open_bundle(bad, tmp_path / f"open-{k}")


# -- what cannot be submitted -------------------------------------------------------------------------------------


def test_what_cannot_be_passed_on_gets_a_sentence(tmp_path: Path) -> None:
    def refused(given: str, said: str, **parameters: str) -> None:
        with pytest.raises(RequestError, match=said):
            source.source_of(given, parameters, tmp_path)

    mine = written(tmp_path / "mine")
    refused("ekf", "ekf comes with simnav")
    refused("no-such-row", "unknown estimator 'no-such-row'")
    refused(str(tmp_path / "none.py"), "there is no file")
    refused(str(mine), "a parameter names a file of this machine", gain=str(mine))


def test_a_name_of_simnav_is_refused(made: Path, tmp_path: Path) -> None:
    def renamed(folder: Path) -> None:
        text = (folder / "bundle.json").read_text()
        (folder / "bundle.json").write_text(text.replace("my-last-fix(gain=0.9)", "oracle"))

    with pytest.raises(RequestError, match="oracle is a name of one of simnav's own estimators"):
        open_bundle(changed(made, tmp_path / "bad.zip", renamed, hashes=False), tmp_path / "open")
