"""A paper is one TOML file: a small one is read and run; mistakes name the file, the key and the value."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import simnav
from simnav.leaderboard.papers import PAPERS
from simnav.leaderboard.papers.claims.declared import claims_of
from simnav.leaderboard.papers.paper import Gain, Value
from simnav.leaderboard.papers.reading import paper_of

DOCS = Path(__file__).parents[3] / "docs" / "papers" / "index.md"

POND = """
authors = "N. Body"
short = "Nobody (2026)"
title = "Tiny"
published = "Nowhere 2026"
about = "a pond"
runs = 3
full = 9
scenario = "pond-noisy"

[methods]
EKF = ["nobody", "ship-ekf"]
Fixes = "gnss-only"

[groups]
both = ["EKF", "Fixes"]

[reasons]
told = "it is told"

[variants.pond-noisy]
of = "ship-turn"
keys = {duration_s = 40.0, "instruments.gnss.sigma_m" = [9.0, 9.0, 9.0]}

[[table]]
title = "Errors"
number = "Table 1"
score = ["north_rmse", "east_rmse"]
higher = {east_rmse = "told"}
rows = [
  {method = "both", paper = {EKF = [0.001, "0.001 to 0.002"]}},
  {method = "EKF", than = "Fixes", paper = 0.5, derived = true},
]

[[claim]]
name = "pond-north"
sentence = "the north RMSE of the EKF is 50 % below that of the fixes"
gain = 0.5
row = "ship-ekf"
than = "gnss-only"
score = "north_rmse"
dials = ["noise"]

[dials.noise]
title = "the noise"
values = [1.0, 4.0]
keys = {"instruments.gnss.sigma_m" = ["value", "2 * value", "8 / value"]}
"""


@pytest.fixture
def pond(tmp_path):
    """Writes the file of a paper, with one text in place of another."""

    def write(old: str = "", new: str = "") -> str:
        assert old in POND
        path = tmp_path / f"pond-{len(list(tmp_path.iterdir()))}.toml"
        path.write_text(POND.replace(old, new, 1) if old else POND)
        return str(path)

    return write


def test_rows_are_those_of_the_file(pond):
    paper = paper_of(pond())
    assert list(paper.rows()) == [
        Value("pond-noisy", "EKF", "north_rmse", 0.001),
        Value("pond-noisy", "EKF", "east_rmse", (0.001, 0.002), higher="it is told"),
        Value("pond-noisy", "Fixes", "north_rmse"),
        Value("pond-noisy", "Fixes", "east_rmse", higher="it is told"),
        Gain("pond-noisy", "EKF", "Fixes", "north_rmse", 0.5, derived=True),
        Gain("pond-noisy", "EKF", "Fixes", "east_rmse", 0.5, derived=True, higher="it is told"),
    ]
    scenario = paper.scenario("pond-noisy")
    assert (scenario.name, scenario.duration, scenario.aids["gnss"].sigma) == ("pond-noisy", 40.0, (9.0, 9.0, 9.0))


def test_a_new_paper_is_one_new_file(pond, tmp_path):
    """The comparison of a file that nothing else knows, with its runs and verdicts."""
    found = simnav.reproduce(pond(), workers=1, output=tmp_path / "out")
    assert (found.paper.short, found.paper.key, len(found.seeds)) == ("Nobody (2026)", "pond-0", 3)
    assert {name: r.label for name, r in found.stands_for.items()} == {"EKF": "ship-ekf", "Fixes": "gnss-only"}
    assert [f.verdict for f in found.findings][:2] == ["differs", "differs"]
    assert found.findings[1].why == "it is told"
    assert all(f.ours is not None and f.ours.runs == 3 for f in found.findings)


def test_a_claim_and_its_dial(pond):
    (claim,) = claims_of(pond())
    base = claim.base()
    (dial,) = claim.dials
    at = dial.set(base, 4.0)
    assert (base.scenario.name, base.row.label, base.than.label) == ("pond-noisy", "ship-ekf", "gnss-only")
    assert at.scenario.name == "pond-noisy-at-noise-4"
    assert at.scenario.aids["gnss"].sigma == (4.0, 8.0, 2.0)
    assert at.than_scenario is at.scenario
    with pytest.raises(simnav.RequestError, match="noise=0: the value should be above 0"):
        dial.set(base, 0.0)


def test_rows_of_a_table_come_for_each_of_its_scenarios(pond):
    many = pond('number = "Table 1"', 'scenario = ["ship-turn", "ship-straight"]')
    rows = list(paper_of(many).rows())
    assert [r.scenario for r in rows] == ["ship-turn"] * 6 + ["ship-straight"] * 6
    text = Path(many).read_text().replace('{method = "EKF", than', '{scenario = "ship-straight", method = "EKF", than')
    Path(many).with_name("some.toml").write_text(text)
    rows = list(paper_of(str(Path(many).with_name("some.toml"))).rows())
    assert [r.scenario for r in rows if isinstance(r, Gain)] == ["ship-straight"] * 2
    assert len(rows) == 10


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("runs = 3", "runs = 'three'", "runs = 'three' should be a number"),
        ("runs = 3", "run = 3", "unknown key 'run' .*did you mean 'runs'"),
        ('about = "a pond"\n', "", "required key 'about' is missing"),
        ("[methods]", "[methods", "at line 11"),
        ('than = "Fixes", p', 'than = "Fixxes", p', r"table\[0\].rows\[1\].than = 'Fixxes' is not known; did you mean"),
        ("paper = {EKF", "paper = {EKFF", r"table\[0\].rows\[0\].paper = 'EKFF' is not known"),
        ('"0.001 to 0.002"', '"about 3"', r"rows\[0\].paper = 'about 3' should be a number, 'none', or a range"),
        ("[0.001, ", "[0.001, 2.0, ", r"paper = .* should have 2 figures, one for each score"),
        ('east_rmse = "told"', 'east_rmse = "tolt"', r"higher = 'tolt' is not known; did you mean 'told'"),
        ('["north_rmse", "east_rmse"]', '"nort_rmse"', r"score = 'nort_rmse' is no score"),
        ("paper = 0.5", 'paper = "0.4 to 0.5"', "a gain should be one number"),
    ],
)
def test_mistakes_name_file_key_and_value(pond, old, new, message):
    path = pond(old, new)
    with pytest.raises(ValueError, match=message) as error:
        paper_of(path)
    assert str(error.value).startswith(path)
    assert "\n" not in str(error.value)


def test_a_claim_names_a_dial_of_its_file(pond):
    with pytest.raises(ValueError, match="the claim pond-north has no dial 'nois'; did you mean 'noise'"):
        claims_of(pond('dials = ["noise"]', 'dials = ["nois"]'))


def test_a_file_that_is_not_there():
    with pytest.raises(simnav.RequestError, match=r"nothing\.toml"):
        simnav.reproduce("nothing.toml")


def test_the_example_of_the_docs_is_a_paper(tmp_path):
    (text,) = re.findall(r"^```toml\n(.*?)^```", DOCS.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    path = tmp_path / "example.toml"
    path.write_text(text)
    assert len(list(paper_of(str(path)).rows())) == 6
    (claim,) = claims_of(str(path))
    assert claim.dials[0].set(claim.base(), 2.0).scenario.aids["gnss"].sigma == (2.0, 2.0, 2.0)


def test_the_papers_are_the_files_of_the_folder():
    from simnav.leaderboard.papers import FOLDER

    assert sorted(PAPERS) == sorted(f.stem for f in FOLDER.glob("*.toml"))
