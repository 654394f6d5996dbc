"""The site, from a small set of made-up results."""

from __future__ import annotations

import csv
import json
import math
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlparse

import numpy as np
import pytest

from simnav.leaderboard.ranking import ranking
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.export import SCHEMA_VERSION
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.site import site
from simnav.scoring import SCORES

HOSTILE = '"><script>alert(1)</script> & {{ 7 * 7 }}/../x'
SIZES = {"oracle": 1.0, "ekf": 1.2, HOSTILE: 3.0, "inertial": 500.0}
SCENARIOS = ("made-up-one-v1", "made-up-two-v3")
SEEDS = range(6)


def result(scenario: str, seed: int, estimator: str, status: str = "ok") -> Result:
    rng = np.random.default_rng([seed, len(scenario), len(estimator)])
    time = np.linspace(1.0, 300.0, 60)
    error = SIZES[estimator] * rng.rayleigh(size=60)
    scores = dict.fromkeys(SCORES, math.nan)
    series = {}
    if status == "ok":
        scores |= {
            "horizontal_rmse": float(np.sqrt(np.mean(error**2))),
            "heading_rmse": math.radians(2.0),
            "availability": 1.0,
            "nees_horizontal": 1.0,
            "nees_horizontal_clean": 1.0,
            "coverage_95": 0.95,
            "update_median": 1e-4,
        }
        track = {"truth_north": time, "truth_east": 0.5 * time}
        track |= {"estimate_north": time + error, "estimate_east": 0.5 * time}
        series = {"time": time, "horizontal": error, "heading": error, "quantiles": np.quantile(error, [0.0, 0.5, 1.0])}
        series = {k: v.astype(np.float32) for k, v in (series | track).items()}
    reason = "" if status == "ok" else f"<b>{status}</b> of {estimator}"
    return Result(scenario, seed, estimator, {"gain": 0.5} if estimator == "ekf" else {}, estimator == "oracle",
                  status, reason, scores, series, "run <i>7</i>", 1.5, 2**20)  # fmt: skip


def rank(results):
    return ranking.rank(results)


@pytest.fixture
def no_figures(monkeypatch):
    monkeypatch.setattr(site, "scenario_figures", lambda *_: [])


@pytest.fixture(scope="module")
def results() -> list[Result]:
    def status(scenario: str, seed: int, estimator: str) -> str:
        if estimator == "inertial" and scenario == SCENARIOS[1]:
            return "unsuitable"
        return "timeout" if estimator == HOSTILE and seed == 2 else "ok"

    return [result(s, k, e, status(s, k, e)) for s in SCENARIOS for e in SIZES for k in SEEDS]


@pytest.fixture(scope="module")
def folder(results, tmp_path_factory) -> Path:
    output = tmp_path_factory.mktemp("board") / "site"
    index = site.build(results, rank(results), output)
    assert index == output / "index.html"
    return output


class Page(HTMLParser):
    """Links, images, tables and scripts of a page; unclosed tags are an error."""

    VOID = ("meta", "link", "img", "br", "input")

    def __init__(self, path: Path):
        super().__init__()
        self.links: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.text = ""
        self.headings: list[dict[str, str | None]] = []
        self.images: list[dict[str, str | None]] = []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        found = dict(attributes)
        self.links += [found[k] for k in ("href", "src") if found.get(k)]
        if tag == "th":
            self.headings.append(found)
        if tag == "img":
            self.images.append(found)
        assert not any(k.startswith("on") for k in found)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def pages(folder: Path) -> dict[str, Page]:
    return {p.name: Page(p) for p in folder.glob("*.html")}


def test_there_is_a_page_for_the_ranking_each_scenario_and_each_estimator(folder):
    assert len(pages(folder)) == 1 + len(SCENARIOS) + len(SIZES)
    assert {f"{s}.html" for s in SCENARIOS} <= set(pages(folder))


def test_every_link_leads_to_a_file_of_the_folder(folder):
    for name, page in pages(folder).items():
        assert page.links
        for link in page.links:
            parsed = urlparse(link)
            if parsed.scheme == "data" or not parsed.path:
                continue
            assert not parsed.scheme, f"{name} needs {link}"
            target = (folder / unquote(parsed.path)).resolve()
            assert target.is_file(), f"{name}: {link}"
            assert target.is_relative_to(folder.resolve())


def test_nothing_is_loaded_from_elsewhere(folder):
    for path in [*folder.glob("*.css"), *folder.glob("*.js"), *folder.glob("figures/*.svg")]:
        text = path.read_text()
        assert "@import" not in text
        assert "url(http" not in text
        assert 'href="http' not in text


def test_hostile_names_are_shown_and_do_nothing(folder):
    found = pages(folder)
    index = found["index.html"]
    for page in found.values():
        assert page.tags.count("script") == 1  # our own
        assert "i" not in page.tags or page is index  # only the bars of the ranking use it
    assert HOSTILE in index.text  # braces and all: names are no templates
    scenario = (folder / f"{SCENARIOS[0]}.html").read_text()
    assert "<script>alert" not in scenario
    assert "&lt;b&gt;timeout&lt;/b&gt;" in scenario
    assert all(p.parent in (folder, folder / "figures") for p in folder.rglob("*") if p.is_file())


def test_tables_and_images_are_accessible(folder):
    for page in pages(folder).values():
        assert page.headings
        assert all(h.get("scope") in ("col", "row") for h in page.headings)
        assert all(i.get("alt") and i.get("width") for i in page.images)


def test_the_ranking_is_on_the_first_page(folder):
    text = (folder / "index.html").read_text()
    assert text.index(">ekf<") < text.index("&lt;script&gt;") < text.index(">inertial<") < text.index(">oracle<")
    shown = Page(folder / "index.html").text
    assert "2 of 12" in shown  # failures of the hostile one
    assert "simnav campaign --scenario made-up-one.toml,made-up-two.toml" in shown
    assert "ekf:gain=0.5" in shown
    assert "consistent" in shown


def test_scenario_page_has_figures_failures_and_who_does_not_suit(folder):
    page = pages(folder)[f"{SCENARIOS[1]}.html"]
    assert len(page.images) == 4
    assert "timeout" in page.text
    assert "Not suited: inertial" in page.text
    assert "2.00" in page.text  # the heading error, in degrees
    for kind in ("trajectory", "error", "cdf", "rmse"):
        for suffix in ("svg", "png"):
            assert (folder / "figures" / f"{SCENARIOS[1]}-{kind}.{suffix}").stat().st_size > 2000


def test_json_keeps_to_its_schema(folder, results):
    document = json.loads((folder / "results.json").read_text(), parse_constant=lambda c: pytest.fail(f"{c} in JSON"))
    schema = json.loads((folder / "results.schema.json").read_text())
    conforms(document, schema, "results.json")
    assert document["schema"]["version"] == SCHEMA_VERSION
    assert len(document["results"]) == len(results)
    first = next(r for r in document["results"] if r["estimator"] == "ekf" and r["seed"] == 3)
    mine = next(r for r in results if r.estimator == "ekf" and r.seed == 3 and r.scenario == first["scenario"])
    assert first["scores"]["horizontal_rmse"] == mine.scores["horizontal_rmse"]
    assert first["scores"]["vertical_rmse"] is None
    assert [row["estimator"] for row in document["ranking"]["tracks"][0]["rows"]] == [
        "ekf",
        HOSTILE,
        "inertial",
        "oracle",
    ]


def conforms(value, schema, where):
    """The part of JSON Schema that ours uses."""
    kinds = {"object": dict, "array": list, "string": str, "integer": int, "number": (int, float), "boolean": bool,
             "null": type(None)}  # fmt: skip
    wanted = schema.get("type", [])
    wanted = [wanted] if isinstance(wanted, str) else wanted
    assert not wanted or any(isinstance(value, kinds[k]) for k in wanted), f"{where} = {value!r} is no {wanted}"
    assert "const" not in schema or value == schema["const"], where
    assert "enum" not in schema or value in schema["enum"], where
    assert "minimum" not in schema or value >= schema["minimum"], where
    assert set(schema.get("required", ())) <= set(value if isinstance(value, dict) else ()), where
    if isinstance(value, dict):
        known, other = schema.get("properties", {}), schema.get("additionalProperties", {})
        for key, item in value.items():
            conforms(item, known.get(key, other), f"{where}.{key}")
    for i, item in enumerate(value if isinstance(value, list) else ()):
        conforms(item, schema.get("items", {}), f"{where}[{i}]")


def test_csv_has_a_row_a_run_and_units_in_its_names(folder, results):
    with (folder / "results.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(results)
    key = {(r["scenario"], int(r["seed"]), r["estimator"]): r for r in rows}
    for r in results:
        row = key[r.scenario, r.seed, r.estimator]
        assert row["status"] == r.status
        if r.status == "ok":
            assert float(row["horizontal_rmse_m"]) == pytest.approx(r.scores["horizontal_rmse"], rel=1e-8)
            assert float(row["heading_rmse_deg"]) == pytest.approx(2.0)
        else:
            assert row["horizontal_rmse_m"] == ""
    assert json.loads(key[SCENARIOS[0], 0, "ekf"]["parameters"]) == {"gain": 0.5}


def test_parquet_holds_the_same_rows(folder, results):
    import pyarrow.parquet as pq

    table = pq.read_table(folder / "results.parquet")
    assert len(table) == len(results)
    assert set(SCORES) <= set(table.column_names)
    assert table.column("horizontal_rmse").null_count == sum(r.status != "ok" for r in results)


@pytest.mark.usefixtures("no_figures")
def test_a_new_site_takes_the_place_of_the_old_one(results, tmp_path):
    output = tmp_path / "site"
    few = [r for r in results if r.scenario == SCENARIOS[0]]
    site.build(few, rank(few), output)
    (output / "left-over.html").touch()
    site.build(few[:12], rank(few[:12]), output)
    assert not (output / "left-over.html").exists()
    assert [p.name for p in tmp_path.iterdir()] == ["site"]


@pytest.mark.usefixtures("no_figures")
def test_a_failure_leaves_the_old_site_and_nothing_else(results, tmp_path, monkeypatch):
    output = tmp_path / "site"
    few = [r for r in results if r.scenario == SCENARIOS[0]]
    site.build(few, rank(few), output)
    before = (output / "index.html").read_bytes()

    def full(*_):
        raise OSError(28, "No space left")

    monkeypatch.setattr(site, "write", full)
    with pytest.raises(OSError, match="No space"):
        site.build(few, rank(few), output)
    assert (output / "index.html").read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["site"]


def test_a_folder_with_other_files_is_left_alone(results, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(RequestError, match="other files"):
        site.build(results, rank(results), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_without_results_there_is_no_site(tmp_path):
    with pytest.raises(RequestError, match="no results"):
        site.build([], rank([]), tmp_path / "site")
    assert not (tmp_path / "site").exists()


def test_where_everything_failed_there_is_still_a_site(tmp_path):
    few = [result(SCENARIOS[0], k, "ekf", "timeout") for k in range(3)]
    page = Page(site.build(few, rank(few), tmp_path / "site"))
    assert "3 of 3" in page.text
    assert "failed" in page.text
