"""Recordings on disk: everything comes back, and no half file is ever left."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import simnav.recording
from simnav.labels import FaultLabel
from simnav.recording import AidStream, Block, ImuLabels, Recording, RecordingError
from simnav.types import (
    Datasheet,
    ImuDatasheet,
    ImuSamples,
    InitialState,
    Instruments,
    NavigationStates,
    TriadDatasheet,
)


def make(imu: bool = True) -> Recording:
    rng = np.random.default_rng(0)

    def states(n: int) -> NavigationStates:
        return NavigationStates(np.arange(1.0, n + 1), *rng.normal(size=(3, n, 3)))

    truth = states(4)
    truth.velocity[2] = np.nan
    sheets = [
        Datasheet("fix", "gnss_position", 1.0, np.array([1.0, 2.0, 3.0]), lever_arm=np.array([1.0, 0.0, -2.0])),
        Datasheet("heading", "gyrocompass", 2.0, np.array([0.1]), correlation_time=300.0),
    ]
    aids = {
        "fix": AidStream(
            "fix", "gnss_position", np.arange(3.0), rng.normal(size=(3, 3)), np.array([0, 5, 0], np.uint32),
            rng.normal(size=(3, 3)), np.ones((3, 3)), np.array([3.0]),
        ),
        "heading": AidStream(
            "heading", "gyrocompass", np.empty(0), np.empty((0, 1)), np.empty(0, np.uint32), np.empty((0, 1)),
            np.empty((0, 1)), np.empty(0),
        ),
    }  # fmt: skip
    samples = ImuSamples(np.arange(8) / 2.0, np.full(8, 0.5), *rng.normal(size=(2, 8, 3))) if imu else None
    labels = ImuLabels(np.arange(8, dtype=np.uint32), rng.normal(size=(8, 6))) if imu else None
    sheet = (
        ImuDatasheet(2.0, TriadDatasheet(random_walk=1e-5), TriadDatasheet(bias=0.1, range=50.0, assumed=("bias",)))
        if imu
        else None
    )
    return Recording(
        "made-up-v3", 7, Instruments(sheets, sheet, 0.5), states(1),
        InitialState(0.0, *rng.normal(size=(3, 3)), np.eye(9)),
        (FaultLabel("outage", ("fix", "heading"), 1.0, np.inf),),
        Block(0.0, 4.0, samples, labels, aids, truth), "a note, with Ünicode",
    )  # fmt: skip


def same(a, b) -> None:
    """Compare recursively, arrays bit for bit."""
    assert type(a) is type(b)
    if isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    elif dataclasses.is_dataclass(a):
        for f in dataclasses.fields(a):
            same(getattr(a, f.name), getattr(b, f.name))
    elif isinstance(a, dict):
        assert list(a) == list(b)
        for k in a:
            same(a[k], b[k])
    elif isinstance(a, Instruments):
        same(dict(a), dict(b))
        same((a.imu, a.step), (b.imu, b.step))
    elif isinstance(a, tuple):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            same(x, y)
    else:
        assert a == b


@pytest.mark.parametrize("imu", [True, False])
def test_everything_comes_back(tmp_path, imu):
    recording = make(imu)
    recording.save(tmp_path / "run.npz")
    same(recording, Recording.load(tmp_path / "run.npz"))
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]


def test_an_interrupted_write_spares_the_file_that_was_there(tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    make().save(path)
    before = path.read_bytes()

    def full(file, **arrays):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(simnav.recording.np, "savez", full)
    with pytest.raises(OSError, match="No space left"):
        make().save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]


def test_a_file_of_another_version(tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    monkeypatch.setattr(simnav.recording, "FORMAT", 99)
    make().save(path)
    monkeypatch.undo()
    with pytest.raises(
        RecordingError, match=r"run\.npz: written in format 99 of recordings, but this version .* record it"
    ):
        Recording.load(path)


@pytest.mark.parametrize("damage", ["half", "text", "empty", "other", "missing", "broken"])
def test_files_that_are_no_recordings(tmp_path, damage):
    path = tmp_path / "run.npz"
    make().save(path)
    whole = path.read_bytes()
    if damage == "half":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "text":
        path.write_text("time,x\n")
    elif damage == "empty":
        path.write_bytes(b"")
    elif damage == "other":
        np.savez(path, x=np.zeros(3))
    else:
        with np.load(path) as file:
            arrays = dict(file)
        if damage == "missing":
            del arrays["truth.time"]
        else:
            arrays["meta"] = np.array(json.dumps(json.loads(str(arrays["meta"])) | {"aids": [{"name": "x"}]}))
        np.savez(path, **arrays)
    with pytest.raises(RecordingError, match=r"run\.npz: not a recording of simnav") as raised:
        Recording.load(path)
    assert "\n" not in str(raised.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(FileNotFoundError):
        Recording.load(tmp_path / "run.npz")
