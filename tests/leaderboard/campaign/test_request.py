"""How an estimator is asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

import simnav
from simnav.estimators.rows.adaptive import Rae
from simnav.estimators.rows.kalman import Ekf
from simnav.leaderboard.campaign.request import request, requests, split_estimators
from simnav.leaderboard.results.errors import RequestError

STILL = """
from simnav import Estimate, Estimator
class Still(Estimator):
    'Stays where it began.'
    def reset(self, start, instruments): self.start = start
    def update(self, measurements): return Estimate(measurements.time, self.start.position)
"""


def test_estimators_are_split_with_their_parameters():
    assert split_estimators(["a:x=1,y=2,b", "c.py:C:z=(1)"]) == [
        ("a", {"x": "1", "y": "2"}),
        ("b", {}),
        ("c.py:C", {"z": "(1)"}),
    ]
    with pytest.raises(ValueError, match="parameters follow a name"):
        split_estimators(["a,x=1"])


def test_former_names_of_parameters_become_present_ones():
    """In a text, a pair, a class, and where several rows are given the same parameter."""
    new = {"innovations": "9"}
    assert request("iae-fixed:window=9").label == request("iae-fixed:innovations=9").label == "iae-fixed(innovations=9)"
    assert request(("rae", {"window": "9"})).parameters == request((Rae, {"window": "9"})).parameters == new
    found = requests("iae,iae-fixed,rae,sw-fgo", {"window": "9"})
    assert [r.label for r in found[1:]] == ["iae-fixed(innovations=9)", "rae(innovations=9)", "sw-fgo(window=9)"]
    assert found[0].parameters == {}
    assert request("no-such-row:window=9").parameters == {"window": "9"}
    with pytest.raises(RequestError, match="'iae-fixed': 'window' is the former name of 'innovations'; give one"):
        request("iae-fixed:window=9,innovations=8")


@pytest.mark.parametrize("asked", ["ekf.py", "ekf,ekf.py", "a/ekf.py:calibrate=no"])
def test_a_file_that_is_called_as_one_of_our_rows_is_refused(asked, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Its results would stand beside the row's name."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").mkdir()
    for folder in (tmp_path, tmp_path / "a"):
        (folder / "ekf.py").write_text(STILL)
    with pytest.raises(RequestError, match=r"ekf\.py: 'ekf' is a row that comes with simnav; give it another name"):
        requests(asked)


def registering(*names: str) -> str:
    """A file that registers classes A, B and so on."""
    parts = [STILL.replace("class Still", f'@simnav.register("{n}")\nclass {c}') for n, c in zip(names, "ABC")]
    return "\n".join(["import simnav", *parts])


@pytest.mark.parametrize(
    ("text", "asked", "label"),
    [
        (registering("my-still"), "f.py", "my-still"),
        (registering("my-still"), "f.py:A:gain=2", "my-still(gain=2)"),
        (registering("my-still").replace('("', '(name="'), "f.py", "my-still"),
        (registering("first", "second"), "f.py", "f"),
        (registering("first", "second"), "f.py:B", "second"),
        (registering("first") + STILL, "f.py", "first"),
        (registering("first") + STILL, "f.py:Still", "f:Still"),
        (registering("No Kebab"), "f.py", "f"),
        (registering("x").replace('"x"', "NAME"), "f.py", "f"),
        (STILL, "f.py", "f"),
        ("def", "f.py", "f"),
        ("raise SystemExit\n" + registering("unrun"), "f.py", "unrun"),
    ],
)
def test_a_file_is_shown_by_the_name_that_it_registers(
    text: str, asked: str, label: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "f.py").write_text(text)
    assert [r.label for r in requests(asked)] == [label]


def test_the_name_that_a_file_registers_must_be_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        (tmp_path / f"{name}.py").write_text(registering("mine"))
    (tmp_path / "c.py").write_text(registering("ekf"))
    with pytest.raises(RequestError, match=r"a\.py and b\.py: the rows of both would be called 'mine'"):
        requests("a.py,b.py")
    with pytest.raises(RequestError, match=r"c\.py: 'ekf' is a row that comes with simnav; give it another name"):
        requests("ekf,c.py")
    assert [r.label for r in requests("a.py,a.py:A")] == ["mine"]


def test_two_files_of_one_name_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "still.py").write_text(STILL)
    with pytest.raises(RequestError, match=r"a/still\.py and b/still\.py: the rows of both would be called 'still'"):
        requests("a/still.py,b/still.py")
    with pytest.raises(RequestError, match="called 'still'"):
        simnav.evaluate("a/still.py", "ship-straight", against=["b/still.py"], runs=1)


def test_what_is_asked_for_twice_is_there_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "still.py").write_text(STILL)
    asked = [Ekf, "ekf", "still.py", tmp_path / "still.py", "ekf:calibrate=no", ("ekf", {"calibrate": "no"})]
    assert [r.label for r in requests(asked)] == ["ekf", "still", "ekf(calibrate=no)"]
