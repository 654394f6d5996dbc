"""Data sets: what is read is what was simulated, the test split tells nothing, and a stopped set continues."""

from __future__ import annotations

import json
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

import simnav
from simnav.environment.seeds import FIRST_TRAINING_SEED, training_seed
from simnav.estimators.training import anfis_training
from simnav.leaderboard import cli
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.seal import read_seal
from simnav.leaderboard.campaign.training_runs import require_unseen
from simnav.leaderboard.dataset import manifest, parts
from simnav.leaderboard.dataset.splits import FIRST_SEEDS, SPLITS
from simnav.leaderboard.dataset.tables import from_tables, to_tables
from simnav.leaderboard.results.errors import MOST_RUNS, RequestError
from simnav.leaderboard.results.hidden import without_truth
from simnav.recording import to_arrays
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial

SHIPS = load("training-ships").model_copy(update={"duration": 30.0})


def files(folder: Path) -> dict[str, bytes]:
    """The Parquet files of a folder, by path."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*.parquet")}


def same(read, simulated, half_steps):
    """Recordings are equal but for rounding: exact where a double is stored, in single precision elsewhere."""
    facts, arrays = to_arrays(read)
    expected_facts, expected = to_arrays(simulated)
    assert json.loads(json.dumps(facts)) == json.loads(json.dumps(expected_facts))
    assert set(arrays) == set(expected)
    for name, array in expected.items():
        assert arrays[name].dtype == array.dtype, name
        if name in half_steps:
            assert np.abs(arrays[name] - array).max() <= half_steps[name], name
        elif name.startswith("truth.") and name not in ("truth.time", "truth.position"):
            np.testing.assert_allclose(arrays[name], array, rtol=1e-7, atol=1e-12)
        elif name.rpartition(".")[2] in ("fault_error", "sigma"):
            np.testing.assert_allclose(arrays[name], array, rtol=1e-7, atol=1e-30)
        else:
            np.testing.assert_array_equal(arrays[name], array, err_msg=name)


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("name", ["training-motion", "training-ships", "satellites-open-sea", "late-aids"])
def test_what_is_read_is_what_was_simulated(name, told):
    scenario = load(name).model_copy(update={"duration": 130.0 if name == "training-motion" else 20.0})
    for seed in range(3):
        recording = record(scenario, seed)
        recording = recording if told else without_truth(recording)
        sheet, limits = recording.instruments.imu, {}
        if sheet is not None:
            for quantity, triad in (("angular_rate", sheet.gyroscope), ("specific_force", sheet.accelerometer)):
                noise, single = triad.random_walk * np.sqrt(sheet.rate), 2.0**-24 * 40.0
                limits[f"imu.{quantity}"] = noise / 64.0 + single
        same(from_tables(to_tables(recording, 7, told), recording.scenario), recording, limits)


def test_the_splits_have_seeds_of_their_own():
    ranges = {split: range(first, first + MOST_RUNS) for split, first in FIRST_SEEDS.items()}
    ordered = sorted(ranges.values(), key=lambda r: r.start)
    assert all(a.stop <= b.start for a, b in pairwise(ordered))
    assert set(ranges) == set(SPLITS)
    # Scored runs are below the first training seed, and parameters of simnav were chosen on seeds far below the test's.
    assert max(ranges["test"]) < FIRST_TRAINING_SEED
    assert min(ranges["test"]) > 2 * anfis_training.FIRST_VALIDATION_SEED
    assert min(min(ranges["train"]), min(ranges["validation"])) > training_seed(MOST_RUNS)
    # No ranked run, sealed or not, starts from such a number.
    assert SHIPS.root(min(ranges["test"])) > 2**63


@pytest.fixture(scope="module")
def key(tmp_path_factory) -> Path:
    """A key file."""
    path = tmp_path_factory.mktemp("secret") / "key"
    simnav.seal(path)
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory, key) -> Path:
    """A small data set, of two parts."""
    folder = tmp_path_factory.mktemp("data") / "ships"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parts, "PART", 3)
        report = simnav.dataset(SHIPS, folder, size=4, sealed=key, workers=1)
    assert {name: (s.voyages, s.duration) for name, s in report.splits.items()} == {
        "train": (4, 120.0), "validation": (1, 30.0), "test": (1, 30.0),
    }  # fmt: skip
    assert sum(s.size for s in report.splits.values()) == sum(map(len, files(folder).values()))
    assert (report.written, report.pace > 0.0) == (6, True)
    return folder


@pytest.fixture
def _small_parts(monkeypatch):
    monkeypatch.setattr(parts, "PART", 3)


@pytest.mark.usefixtures("_small_parts")
def test_a_stream_has_the_voyages_of_the_files(made, key):
    for split in SPLITS:
        read = list(simnav.read_voyages(made, split))
        assert read[0].seed == FIRST_SEEDS[split]
        for one, streamed in zip(read, simnav.voyages(SHIPS, split, sealed=key), strict=False):
            same(one, streamed, {})
    (third, first) = simnav.read_voyages(made, numbers=[3, 0])
    assert [third.seed, first.seed] == [FIRST_SEEDS["train"] + 3, FIRST_SEEDS["train"]]
    assert [r.seed - FIRST_SEEDS["train"] for r in simnav.voyages(SHIPS, numbers=[5, 2])] == [5, 2]


def test_a_row_group_is_a_voyage(made):
    for path in (made / "train" / "00000").iterdir():
        file = parquet.ParquetFile(path)
        assert file.num_row_groups == 3
        for i in range(3):
            assert set(file.read_row_group(i)["voyage"].to_pylist()) <= {i}


def test_the_test_split_tells_neither_truth_nor_labels(made):
    assert {p.split("/")[-1] for p in files(made / "test")} == {"voyages.parquet", "imu.parquet", "aids.parquet"}
    columns = {name for path in (made / "test").rglob("*.parquet") for name in parquet.read_schema(path).names}
    train = {name for path in (made / "train").rglob("*.parquet") for name in parquet.read_schema(path).names}
    told = train - columns
    assert {"faults", "draws", "actual", "latitude_rad", "fault_error", "sigma", "time_of_validity_s"} <= told
    assert not {name for name in columns if name.startswith(("initial", "fault", "sigma", "current"))}


@pytest.mark.usefixtures("_small_parts")
def test_the_test_split_is_scored_by_simnav(made, key, tmp_path):
    (hidden,) = simnav.read_voyages(made, "test")
    trial = run_trial(simnav.make("gnss-only"), hidden)
    rows = np.column_stack([trial.time, np.degrees(trial.position[:, :2])])
    np.savetxt(tmp_path / "mine.csv", rows, "%.17g", ",", header="time_s,latitude_deg,longitude_deg", comments="")
    scored = simnav.score_files(SHIPS, [tmp_path / "mine.csv"], seed=hidden.seed, sealed=key)
    ran = simnav.run(SHIPS, "gnss-only", seed=read_seal(key).seed(SHIPS.id, hidden.seed))
    errors = [report.to_dict()["estimators"][0]["scores"]["horizontal_rmse"] for report in (scored, ran)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-9)


def test_sealed_seeds_follow_from_the_key(made, key, tmp_path):
    (sealed,) = islice(simnav.voyages(SHIPS, "test", sealed=key), 1)
    number = FIRST_SEEDS["test"]
    expected, public = record(SHIPS, read_seal(key).seed(SHIPS.id, number)), record(SHIPS, number)
    assert sealed.seed == number
    np.testing.assert_array_equal(sealed.data.aids["gnss"].value, expected.data.aids["gnss"].value)
    assert not np.array_equal(public.start.position, sealed.start.position)
    assert next(simnav.voyages(SHIPS, sealed=key)).seed == FIRST_SEEDS["train"]
    text = (made / "README.md").read_text()
    assert "--sealed KEYFILE" in text
    assert read_seal(key).hash in text
    simnav.seal(tmp_path / "other")
    with pytest.raises(RequestError, match=r"the seeds of split test there are sealed by the key .*, and not seale"):
        simnav.dataset(SHIPS, made, size=1, splits="test", sealed=tmp_path / "other", workers=1)


def test_there_is_no_test_split_without_a_key(tmp_path):
    message = (
        "split test needs 'sealed', a key file: from public seeds anybody could simulate its truth; 'simnav campaign"
    )
    with pytest.raises(RequestError, match=message):
        simnav.dataset(SHIPS, tmp_path / "set", size=1, splits="train,test", workers=1)
    with pytest.raises(RequestError, match=message):
        simnav.voyages(SHIPS, "test")
    assert not (tmp_path / "set").exists()
    assert set(simnav.dataset(SHIPS, tmp_path / "set", size=1, workers=1).splits) == {"train", "validation"}


@pytest.mark.usefixtures("_small_parts")
def test_it_continues_where_it_was_and_grows(made, key, tmp_path):
    folder, whole = tmp_path / "set", files(made)
    assert simnav.dataset(SHIPS, folder, size=2, splits=["train"], workers=1).written == 2
    assert simnav.dataset(SHIPS, folder, size=4, splits="validation, train", workers=1).written == 5  # 2 of them anew
    assert simnav.dataset(SHIPS, folder, size=4, sealed=key, workers=1).written == 1
    assert files(folder) == whole
    (folder / "train" / "00001" / "voyages.parquet").write_bytes(b"half")
    assert simnav.dataset(SHIPS, folder, size=1, workers=1).written == 1  # the larger size counts
    assert json.loads((folder / "dataset.json").read_text())["sizes"] == {"train": 4, "validation": 1, "test": 1}
    assert files(folder) == whole


@pytest.mark.usefixtures("_small_parts")
def test_a_part_that_was_stopped_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(parts, "recordings", lambda *given: stopped(*given))

    def stopped(*_):
        yield record(SHIPS, 0)
        raise OSError(28, "No space left on device")

    with pytest.raises(RequestError, match="No space left on device"):
        simnav.dataset(SHIPS, tmp_path / "set", size=2, workers=1)
    assert not list((tmp_path / "set" / "train").iterdir())
    with pytest.raises(RequestError, match="00000 is missing; 'simnav dataset' with the same folder writes what is"):
        next(simnav.read_voyages(tmp_path / "set"))


def test_two_processes_write_the_same_files(made, key, tmp_path, monkeypatch):
    monkeypatch.setattr(parts, "PART", 3)
    told = []
    report = simnav.dataset(
        SHIPS, tmp_path / "set", size=4, sealed=key, workers=2, progress=lambda *done: told.append(done)
    )
    assert files(tmp_path / "set") == files(made)
    assert report.written == 6
    assert told[-1] == (6, 6)


def test_the_card_says_what_it_is(made):
    text = (made / "README.md").read_text()
    for words in (
        "`training-ships-v1`", "| train | 4 |", "simulator 1", "MIT", "`fault_error`", "learned_from",
        f"| {FIRST_SEEDS['validation']} |", "simnav score training-ships ESTIMATES.csv --seed SEED",
    ):  # fmt: skip
        assert words in text
    learned = json.loads((made / "dataset.json").read_text())["learned_from"]
    assert learned["train"] == [SHIPS.root(FIRST_SEEDS["train"]), SHIPS.root(FIRST_SEEDS["train"] + 3)]
    assert set(learned) == {"train", "validation"}


def test_an_estimator_that_learned_from_it_is_not_scored_on_it(made):
    ranges = tuple(map(tuple, json.loads((made / "dataset.json").read_text())["learned_from"].values()))
    learned, first = Entrant("learned", {}, "learned", False, "", learned_from=ranges), FIRST_SEEDS["validation"]
    with pytest.raises(RequestError, match=r"'learned' has learned from .* seed 3298534883328 of training-"):
        require_unseen([learned], [SHIPS], range(first, first + 1))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"family": "training-shps"}, "there is no scenario 'training-shps'; did you mean 'training-ships'"),
        (
            {"family": "random-voyages"},
            "random-voyages-v.* is ranked, so nothing may be learned from it; a data set",
        ),
        ({"splits": "train,holdout"}, "there is no split 'holdout'; valid here: test, train, validation"),
        ({"splits": ["tset"]}, "there is no split 'tset'; did you mean 'test'"),
        ({"splits": []}, "no split was named"),
        ({"splits": [3]}, "there is no split 3"),
        ({"size": 0}, "size = 0: a whole number from 1 up is wanted"),
        ({"size": 2_000_000}, "size = 2000000: at most 1000000 voyages are possible"),
        ({"output": "other"}, "other holds other files; choose a new or an empty folder"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").write_text("mine")
    with pytest.raises(RequestError, match=message) as found:
        simnav.dataset(**{"family": SHIPS, "output": "set", "size": 1, "workers": 1, **arguments})
    assert "\n" not in str(found.value)
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize("given", ["random-ships", "nowhere", 5])
def test_no_voyages_are_simulated_of_what_is_no_training_family(given):
    with pytest.raises(RequestError):
        simnav.voyages(given)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 0}, "the data set has format 0, and this version of simnav reads format 1"),
        ({"family": "training-ships-v9"}, "family of the data set there is training-ships-v9, and not training-ships-"),
        ({"simulator": 9}, "version of the simulator of the data set there is 9, and not 1; choose another folder"),
        ({"content": "other"}, "content of the family's file of the data set there is other, and not "),
        ({"sizes": {"holdout": 1}}, "not the description of a data set, or damaged"),
        ({"more": 1}, "not the description of a data set, or damaged"),
    ],
)
def test_a_folder_of_another_version_is_refused(made, tmp_path, change, message):
    found = json.loads((made / manifest.FILE).read_text())
    (tmp_path / manifest.FILE).write_text(json.dumps({**found, **change}))
    with pytest.raises(RequestError, match=message):
        simnav.dataset(SHIPS, tmp_path, size=1, workers=1)


@pytest.mark.usefixtures("_small_parts")
def test_what_is_not_there_cannot_be_read(made, tmp_path):
    with pytest.raises(RequestError, match=r"holds no data set: there is no dataset.json; 'simnav dataset' makes one"):
        simnav.read_voyages(tmp_path)
    with pytest.raises(RequestError, match="there is no split 'holdout'"):
        simnav.read_voyages(made, "holdout")
    with pytest.raises(RequestError, match="there is no voyage 5 of split train"):
        next(simnav.read_voyages(made, numbers=[5]))
    with pytest.raises(RequestError, match="numbers = -1: a whole number from 0 up is wanted"):
        next(simnav.read_voyages(made, numbers=[-1]))
    simnav.dataset(SHIPS, tmp_path / "set", size=1, splits="train", workers=1)
    with pytest.raises(RequestError, match="there is no split 'test' in this data set, only train"):
        simnav.read_voyages(tmp_path / "set", "test")
    (tmp_path / "set" / "train" / "00000" / "aids.parquet").write_bytes(b"PAR1 no more")
    with pytest.raises(RequestError):
        next(simnav.read_voyages(tmp_path / "set"))


def test_the_command(tmp_path):
    words = [
        "dataset",
        "training-ships",
        "--size",
        "2",
        "--split",
        "train,validation",
        "--output",
        str(tmp_path / "set"),
    ]
    said = json.loads(CliRunner().invoke(cli.app, [*words, "--workers", "1", "--json"]).stdout)
    assert {name: split["voyages"] for name, split in said["splits"].items()} == {"train": 2, "validation": 1}
    assert said["bytes_per_second_of_voyage"] == pytest.approx(
        sum(s["size"] for s in said["splits"].values()) / (3 * 600.0)
    )
    again = CliRunner().invoke(cli.app, words)
    assert again.exit_code == 0, again.output
    assert "written:  0 voyages" in again.output
    wrong = CliRunner().invoke(cli.app, [*words, "--split", "holdout"])
    assert wrong.exit_code == 2
    assert "there is no split 'holdout'" in wrong.stderr
