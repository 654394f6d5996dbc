"""The site: its files, its pages as HTML, and its data."""

from __future__ import annotations

import base64
import json
import re
import zlib
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import numpy as np
import pyarrow.parquet as pq
import pytest

from simnav.estimator import find, names
from simnav.leaderboard.campaign.request import comes_with_simnav
from simnav.leaderboard.ranking.board import TrackRow
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.runs import group
from simnav.leaderboard.ranking.stored_costs import cost_of
from simnav.leaderboard.results import export
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.export import SCHEMA_VERSION
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.results.web_addresses import Home
from simnav.leaderboard.site import charts, site, sweeps
from simnav.leaderboard.site.background import Background
from simnav.leaderboard.site.curves import gather
from simnav.leaderboard.site.entries import entries
from simnav.leaderboard.site.facts import datasheets, estimator_facts
from simnav.leaderboard.site.overview import bar_scale, track_data
from simnav.leaderboard.site.scenario_page import ScenarioData, track_from
from simnav.scenario import load
from simnav.scoring import SCORES
from simnav.source import record
from tests.leaderboard.site.conftest import made_up_sweep

SCENARIOS = ("made-up-one-v1", "made-up-two-v3")
LARGEST = 500_000  # bytes of a page or of a file that it reads, Vega aside


@pytest.fixture
def no_charts(monkeypatch):
    """Building is quick where nobody looks at a page."""

    def nothing(entry, ranking, *_):
        page = {"kind": "scenario", "reference": "", "remarks": [], "unsuitable": [], "failures": [], "instruments": [],
                "provisional": False, "sweeps": [], "rows": {}, "drawn": [], "timed": 0}  # fmt: skip
        return ScenarioData(page, (), ())

    monkeypatch.setattr(site, "scenario_data", nothing)
    monkeypatch.setattr(site, "bundle", lambda: "")


def tracks_of(folder: Path) -> list[dict[str, Any]]:
    """The tracks of the board."""
    return [t for page in sorted(folder.glob("board-*.html")) for t in data_of(page)["tracks"]]


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


def data_of(path: Path) -> dict[str, Any]:
    """The data of a page."""
    text = (path.parent / "data" / f"{path.stem}.js").read_text()
    found = re.fullmatch(r'simnav\.packed\["(.*)"\] = "(.*)";\n', text)
    assert found is not None
    assert f'data-page="{found[1]}"' in path.read_text()
    return json.loads(zlib.decompress(base64.b64decode(found[2])))


def test_there_is_a_page_for_the_board_each_scenario_and_each_estimator(folder, results):
    scenarios, estimators = {r.scenario for r in results}, {r.estimator for r in results}
    assert len(pages(folder)) == 4 + len(scenarios) + len(estimators)
    assert {f"{s}.html" for s in scenarios} <= set(pages(folder))


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


def test_pages_and_data_are_small_and_need_nothing_from_elsewhere(folder):
    for path in [*folder.glob("*.html"), *folder.glob("data/*.js")]:
        assert path.stat().st_size < LARGEST, path.name
    for path in [*folder.glob("*.css"), *(p for p in folder.glob("*.js") if p.name != "vega.js")]:
        text = path.read_text()
        assert "@import" not in text
        assert "url(http" not in text
        assert not set(re.findall(r"https?://[^\"' ]+", text)) - {"https://vega.github.io/schema/vega-lite/v6.json"}
    assert "University of Washington" in (folder / "vega.js").read_text()[:500]


def test_hostile_names_are_shown_and_do_nothing(folder, hostile):
    for name, page in pages(folder).items():
        assert page.tags.count("script") == 7, name  # our own, and the data
        assert "i" not in page.tags
    assert hostile in {row["name"]["text"] for row in tracks_of(folder)[0]["table"]["rows"]}
    scenario = (folder / f"{SCENARIOS[0]}.html").read_text()
    assert "<script>alert" not in scenario
    assert "&lt;b&gt;timeout&lt;/b&gt;" in scenario
    assert all(p.parent in (folder, folder / "data") for p in folder.rglob("*") if p.is_file())


def test_static_tables_and_images_are_accessible(folder):
    for page in pages(folder).values():
        assert all(h.get("scope") in ("col", "row") for h in page.headings)
        assert all(i.get("alt") and i.get("width") for i in page.images)


def test_the_board_has_a_table_a_track_and_shows_identical_oracles_once(folder, catalogued, hostile):
    tracks = {t["key"]: t for t in tracks_of(folder)}
    assert len(tracks) == 2
    rows = {row["name"]["text"]: row for row in tracks["other"]["table"]["rows"]}
    assert list(rows)[:3] == ["sw-fgo", "ekf", hostile]
    assert "oracle-mixture" not in rows
    assert re.fullmatch("reference,( older version,)? same result: oracle-mixture", rows["oracle"]["name"]["note"])
    assert rows[hostile]["failed"] == {"text": "2 of 24", "value": 2}
    assert rows["inertial"]["mark"] == "unsuitable"
    assert rows["ekf"]["ranks"]["text"] is None  # fewer than five rows are not ordered
    shown = Page(folder / "about.html").text
    assert f"--scenario PATH/TO/made-up-one.toml,PATH/TO/made-up-two.toml,{catalogued}" in shown
    assert "ekf:gate=3.5" in shown


def test_costs_are_multiples_of_the_plain_row_and_what_is_not_measured_is_named(folder, hostile):
    track = tracks_of(folder)[1]
    rows = {r["name"]["text"]: r for r in track["table"]["rows"]}
    measured = cost_of("sw-fgo", "ekf", "horizontal_rmse")
    assert rows["sw-fgo"]["cost"]["value"] == pytest.approx(measured.value, rel=1e-2)
    assert rows["sw-fgo"]["cost_spread"]["low"] == pytest.approx(measured.low, rel=1e-2)
    assert rows["sw-fgo"]["wall"] == pytest.approx(6e-4)  # as the runs say
    assert rows[hostile]["cost"]["text"] == "not measured"
    assert "simnav bench NAME" in rows[hostile]["cost"]["help"]
    chart = next(c for c in track["charts"] if c["name"].endswith("-cost"))
    points = chart["data"]["rows"]
    assert points["cost"][points["row"].index("sw-fgo")] == rows["sw-fgo"]["cost"]["value"]
    assert hostile not in points["row"]
    assert "Cost not measured: " in chart["caption"]
    assert "Processor time (× ekf)" in json.dumps(chart["spec"], ensure_ascii=False)


def test_the_map_has_the_error_of_each_row_beside_the_plain_row_s_on_each_scenario(folder):
    track, one = tracks_of(folder)
    assert one["map"] is None  # of a single scenario
    cells = track["map"]["data"]["cells"]
    found = {(r, s): x for r, s, x in zip(cells["row"], cells["scenario"], cells["ratio"], strict=True)}
    rows = {r["name"]["text"]: r for r in track["table"]["rows"]}
    names = {s["id"]: s["name"] for s in track["scenarios"]}
    for row in {row for row, _ in found}:
        for identity, name in names.items():
            mine, plain = (rows[r][f"s:{identity}"]["value"] for r in (row, "ekf"))
            assert found[row, name] == pytest.approx(mine / plain, rel=0.02)
    assert {found["ekf", name] for name in names.values()} == {1.0}
    assert cells["row"][0] == min({row for row, _ in found}, key=lambda r: rows[r]["score"]["value"])
    assert track["map"]["data"]["scenarios"]["page"] == [s["page"] for s in track["scenarios"]]


def test_a_row_far_behind_is_named_below_the_chart_of_costs_and_flattens_none():
    labels = ["ekf", "ukf", "sw-fgo", "ckf", "iekf", "inekf", "iae", "imm", "student-t", "mckf", "inertial"]
    errors = {n: 1.0 + 0.1 * i for i, n in enumerate(labels)} | {"inertial": 900.0}
    results = [
        Result("made-up-one-v1", k, n, {}, False, "ok", "", {"horizontal_rmse": error})
        for n, error in errors.items()
        for k in range(6)
    ]
    ranking = rank(results)
    track = track_data(ranking.tracks[0], *entries(group(results), ranking), group(results))
    chart = next(c for c in track["charts"] if c["name"].endswith("-cost"))
    assert "inertial" not in chart["data"]["rows"]["row"]
    assert len(chart["data"]["rows"]["row"]) == len(labels) - 1
    assert "Above the chart: inertial (" in chart["caption"]


def test_a_board_says_how_many_voyages_a_row_learned_from_and_how_large_its_network_is():
    learned = {"trained_on": {"voyages": 900, "parameters": 50, "families": ["a", "b"]}}
    results = [
        Result("made-up-one-v1", k, n, {}, False, "ok", "", {"horizontal_rmse": 1.0}, learned=told)
        for n, told in (("ekf", {}), ("net", learned), ("untold", {"learned_from": [[1, 2]]}))
        for k in range(6)
    ]
    ranking = rank(results)
    table = track_data(ranking.tracks[0], *entries(group(results), ranking), group(results))["table"]
    hidden = {c["key"]: c.get("hidden", False) for c in table["columns"]}
    assert (hidden["voyages"], hidden["parameters"]) == (True, True)  # shown at first where all rows learned
    cells = {row["name"]["text"]: (row["voyages"], row["parameters"]) for row in table["rows"]}
    assert cells["net"] == ({"text": "900", "value": 900}, {"text": "50", "value": 50})
    assert cells["ekf"] == cells["untold"] == (None, None)


def test_one_row_far_behind_does_not_decide_the_scale_of_the_bars():
    rows = [TrackRow(estimator=str(k), standing="ranked", score=1.0 + 0.1 * k) for k in range(19)]
    assert bar_scale(rows) == (1.0, 2.8)
    assert bar_scale([*rows, TrackRow(estimator="inertial", standing="ranked", score=707.0)]) == (
        1.0,
        pytest.approx(4.05),
    )
    assert bar_scale([]) == (1.0, 2.0)


def test_the_results_are_said_to_come_from_where_they_were_computed(folder):
    text = Page(folder / "about.html").text
    assert "simnav-bench 1.0" in text
    assert "c0ffeec0ffee with changes" in " ".join(text.split())
    assert "A processor, 2 cores" in text
    assert "@software{simnav-bench-1.0" in text
    assert "Rank interval" in text  # the glossary


def test_a_scenario_of_the_catalogue_says_what_happens_with_which_instruments(folder, catalogued):
    page, data = Page(folder / f"{catalogued}.html"), data_of(folder / f"{catalogued}.html")
    assert "gyroscope" in page.text
    assert f'name = "{catalogued.rpartition("-v")[0]}"' in page.text  # the TOML file
    names = [c["name"] for c in data["charts"]]
    assert names[:2] == ["timeline", "horizontal"]
    assert {"cdf", "rmse", "nees", "stanford"} <= set(names)
    assert [c["name"] for c in data["inside"]] == ["weight-gnss"]
    assert "oracle and oracle-mixture gave the same errors in every run." in data["remarks"]
    assert data["charts"][1]["data"]["bound"]["bound"]
    assert data["runs"]["seeds"][0] == 0
    assert data["runs"]["data"]["0"]["charts"]["track"]["curves"]["rows"]["ekf"]


def test_a_scenario_shows_its_sweeps_with_breaking_points(folder, catalogued):
    page, data = Page(folder / f"{catalogued}.html"), data_of(folder / f"{catalogued}.html")
    assert "How large a fault may be: Jump [m]" in page.text
    assert "beyond 4.0" in page.text  # the one that does not break
    (sweep,) = data["sweeps"]
    chart, at_value = sweep["charts"]
    assert (sweep["values"], sweep["dial"]) == ([0.0, 2.0, 4.0], {"title": "Jump", "unit": "m"})  # of the slider
    low, high = at_value["spec"]["layer"][1]["encoding"]["x"]["scale"]["domain"]
    assert 0.0 < low < 1.0 < high  # of all values, so that the axis stands still
    assert chart["data"]["curves"]["rows"]["ekf"]["value"] == [0.0, 2.0, 4.0]
    assert chart["data"]["marks"]["rows"] == {"ekf": {"at": [3.0], "threshold": [2.0]}}


def test_a_sweep_of_former_names_of_parameters_is_shown_under_the_present_ones(tmp_path: Path):
    content = json.dumps(made_up_sweep("bay-v1").content).replace('"sw-fgo"', '"rae(window=9)"')
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "sweep-jump.json").write_text(content)
    (found,) = sweeps.sweeps_in(tmp_path)
    assert found.rows == ["ekf", "rae(innovations=9)"]
    assert [b["estimator"] for b in found.content["breaking_points"]] == found.rows


def test_a_scenario_from_elsewhere_has_failures_and_who_does_not_suit(folder):
    page, data = Page(folder / f"{SCENARIOS[1]}.html"), data_of(folder / f"{SCENARIOS[1]}.html")
    assert "timeout" in page.text
    assert [u["name"] for u in data["unsuitable"]] == ["inertial"]
    (late,) = [f for f in data["failures"] if f["status"] == "timeout"]
    assert late["names"].endswith(f" ({late['runs']})")
    assert late["runs"] > 0
    row = next(r for r in data["table"]["rows"] if r["name"]["text"] == "ekf")
    assert row["heading_rmse"]["value"] == pytest.approx(2.0)  # in degrees
    assert all(c["name"] != "timeline" for c in data["charts"])


def test_commands_name_the_file_of_a_scenario_that_does_not_come_with_simnav(results, folder, catalogued, tmp_path,
                                                                             no_charts):  # fmt: skip
    own = [r for r in results if r.scenario in SCENARIOS]
    site.build(own, rank(own), tmp_path / "own")
    text = Page(tmp_path / "own" / "about.html").text
    assert "--scenario PATH/TO/made-up-one.toml,PATH/TO/made-up-two.toml --estimator" in text
    assert "simnav evaluate my_filter.py --scenario PATH/TO/made-up-one.toml --runs 20" in text
    assert "The scenarios made-up-one, made-up-two are not part of simnav" in text
    assert "The scenario made-up-one is not part of simnav" in Page(folder / f"{SCENARIOS[0]}.html").text
    assert "not part of simnav" not in Page(folder / f"{catalogued}.html").text


def test_captions_speak_of_shaded_faults_only_where_faults_are_shaded(folder, catalogued):
    def captions(name: str) -> str:
        data = data_of(folder / f"{name}.html")
        return " ".join(c["caption"] for c in [*data["charts"], *data["inside"], *data["runs"]["charts"]])

    known, unknown = captions(catalogued), captions(SCENARIOS[0])
    for words in (
        "Shaded: faults of seed 0.",
        "Of this run. Shaded: faults.",
        "Wide: where faults act.",
        "Grey: fixes.",
    ):
        assert words in known
        assert words not in unknown
    assert "Shaded" not in unknown
    assert "Of this run." in unknown


def test_the_page_of_an_estimator_says_what_it_is(folder):
    page, data = Page(folder / "estimator-sw-fgo.html"), data_of(folder / "estimator-sw-fgo.html")
    assert "Factor graph" in page.text
    assert "estimators/rows/windows.py, line" in page.text
    meant = {p["name"]: p["meaning"] for p in data["parameters"]}
    assert meant["window"].startswith("Number of epochs")
    assert meant["iterations"]
    assert page.text.index("Where it is robust") < page.text.index("By scenario")
    assert data["table"]["sort"] == "-score"
    assert data["plain"]["label"] == "ekf"
    assert data["worst"]["command"].startswith("simnav run ")
    assert [c["name"] for c in data["worst"]["charts"]][-1] == "run-weight-gnss"
    assert len(data["worst"]["charts"]) == 4


def test_every_chart_is_drawn_for_print(folder, results, tmp_path, catalogued):
    """By the library itself, without a browser."""
    from simnav.leaderboard.site.print_figures import filled, write_figure

    some = ("timeline", "horizontal", "rmse", "stanford")
    for chart in (c for c in data_of(folder / f"{catalogued}.html")["charts"] if c["name"] in some):
        made = charts.Chart(**chart)
        svg, png = write_figure(filled(made, ["ekf", "sw-fgo"]), tmp_path / made.name)
        drawn = svg.read_text()
        assert drawn.startswith("<svg")
        assert "ekf" in drawn or not made.byrow, made.name
        assert png.read_bytes().startswith(b"\x89PNG")


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
    assert [t["track"] for t in document["ranking"]["tracks"]] == ["other", "fjords"]


def test_files_of_many_runs_are_short(folder, results, tmp_path, monkeypatch):
    monkeypatch.setattr(export, "MOST_IN_JSON", len(results) - 1)
    document = export.Document(results, rank(results).to_dict())
    export.write_json(document, tmp_path / "results.json")
    short = json.loads((tmp_path / "results.json").read_text())
    conforms(short, json.loads((folder / "results.schema.json").read_text()), "results.json")
    assert (short["results"], short["ranking"]["scenarios"]) == ([], [])
    assert short["ranking"]["tracks"]
    export.write_parquet(document, tmp_path / "results.parquet")
    rounded, whole = pq.read_table(tmp_path / "results.parquet"), export.table(results)
    assert rounded.schema.equals(whole.schema, check_metadata=True)
    for name in whole.column_names:
        a, b = rounded[name], whole[name]
        assert a.null_count == b.null_count, name
        if b.type == "double":
            digits = 7 if name == "seconds" or name.startswith("update_") else 10
            np.testing.assert_allclose(a.to_numpy(), b.to_numpy(), rtol=2.0**-digits, err_msg=name)
        elif name == "peak_memory":
            np.testing.assert_allclose(a.to_numpy(), b.to_numpy(), atol=65536, err_msg=name)
        else:
            assert a.equals(b), name


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


def test_parquet_holds_the_same_rows(folder, results):
    table = pq.read_table(folder / "results.parquet")
    assert len(table) == len(results)
    assert set(SCORES) <= set(table.column_names)
    assert not list(folder.glob("*.csv"))
    assert table.column("horizontal_rmse").null_count == sum(r.status != "ok" for r in results)


def test_recordings_that_are_known_are_not_made_again(results, catalogued, tmp_path, monkeypatch):
    def made(*_):
        raise AssertionError("a recording was made")

    monkeypatch.setattr(site, "background_of", made)
    monkeypatch.setattr(site, "bundle", lambda: "")
    mine = [r for r in results if r.scenario == catalogued]
    run = {"faults": charts.NO_FAULTS, "track": track_from([])}
    known = Background(bound={"time": [0.0, 300.0], "bound": [0.5, 0.625]}, runs={"0": run})
    site.build(mine, rank(mine), tmp_path / "site", backgrounds={catalogued: known})
    (chart,) = (c for c in data_of(tmp_path / "site" / f"{catalogued}.html")["charts"] if c["name"] == "horizontal")
    assert "0.625" in json.dumps(chart)
    with pytest.raises(AssertionError, match="a recording was made"):  # another run is shown
        site.build(mine, rank(mine), tmp_path / "two", backgrounds={catalogued: known}, runs_shown=2)


@pytest.mark.usefixtures("no_charts")
def test_runs_without_series_are_not_read_one_by_one(results, tmp_path, monkeypatch):
    read = []
    monkeypatch.setattr(site, "gather", lambda *asked: read.append(asked) or gather(*asked))
    few = [replace(r, series={}) if r.estimator == "ekf" else r for r in results if r.scenario == SCENARIOS[0]]
    site.build(few, rank(few), tmp_path / "site")
    assert len(read) == 1


@pytest.mark.usefixtures("no_charts")
def test_a_new_site_takes_the_place_of_the_old_one(results, tmp_path):
    output = tmp_path / "site"
    few = [r for r in results if r.scenario == SCENARIOS[0]]
    site.build(few, rank(few), output)
    (output / "left-over.html").touch()
    site.build(few[:12], rank(few[:12]), output)
    assert not (output / "left-over.html").exists()
    assert [p.name for p in tmp_path.iterdir()] == ["site"]


@pytest.mark.usefixtures("no_charts")
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


def test_a_site_for_print_of_three_seeds_has_all_figures_and_speaks_of_no_interval(results, tmp_path):
    seeds = sorted({r.seed for r in results})[:3]
    few = [r for r in results if r.scenario == SCENARIOS[0] and r.seed in seeds and r.estimator in ("ekf", "sw-fgo")]
    output = tmp_path / "site"
    site.build(few, rank(few), output, figures=True)
    names = {p.name for p in (output / "figures").iterdir()}
    (board,) = (n for n in names if n.startswith("board-") and n.endswith(".svg"))
    assert "95 % interval" not in (output / "figures" / board).read_text()
    made = data_of(output / f"{SCENARIOS[0]}.html")["charts"]
    assert made
    assert {f"{SCENARIOS[0]}-{c['name']}.png" for c in made} <= names
    captions = " ".join(c["caption"] for c in made)
    assert "Point: the median." in captions
    assert "95 % interval" not in captions


def test_a_folder_with_other_files_is_left_alone(results, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(RequestError, match="other files"):
        site.build(results, rank(results), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_without_results_there_is_no_site(tmp_path):
    with pytest.raises(RequestError, match="no results"):
        site.build([], rank([]), tmp_path / "site")
    assert not (tmp_path / "site").exists()


def test_where_everything_failed_there_is_still_a_site(results, tmp_path):
    lost = {"status": "timeout", "reason": "too slow", "scores": {}, "series": {}}
    few = [replace(r, **lost) for r in results if r.scenario == SCENARIOS[0] and r.estimator == "ekf"]
    index = site.build(few, rank(few), tmp_path / "site")
    (row,) = tracks_of(index.parent)[0]["table"]["rows"]
    assert row["failed"]["text"] == "12 of 12"
    assert "too slow" in Page(tmp_path / "site" / f"{SCENARIOS[0]}.html").text


def test_charts_offer_only_rows_of_which_curves_are_kept(results, tmp_path):
    few = [r for r in results if r.scenario == SCENARIOS[0]]
    ranking = rank(few)
    best = next(r.estimator for r in ranking.scenario(SCENARIOS[0]).rows if not r.reference)
    without = [replace(r, series={}) if r.estimator == best else r for r in few]
    site.build(without, ranking, tmp_path / "site")
    page = data_of(tmp_path / "site" / f"{SCENARIOS[0]}.html")
    assert best in page["rows"]
    assert best not in {*page["drawn"], *page["first"]}
    assert set(page["first"]) <= set(page["drawn"])
    words = f"Curves over time are kept of {len(page['drawn'])} of the {len(page['rows'])} rows."
    assert words in Page(tmp_path / "site" / f"{SCENARIOS[0]}.html").text


def test_two_processes_write_the_same_site_as_one(results, tmp_path, monkeypatch):
    monkeypatch.setattr(site, "WORTH_PROCESSES", 1)
    ranking = rank(results)
    written = []
    for workers in (1, 2):
        site.build(results, ranking, tmp_path / str(workers), workers=workers)
        files = sorted(p for p in (tmp_path / str(workers)).rglob("*") if p.suffix in (".html", ".js"))
        texts = {str(p.relative_to(tmp_path / str(workers))): p.read_text() for p in files}
        written.append({n: re.sub(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC", "", text) for n, text in texts.items()})
    assert written[0] == written[1]


def test_a_scenario_that_fails_in_another_process_ends_the_build(results, tmp_path, monkeypatch):
    def fails(*_):
        raise RuntimeError("no page today")

    monkeypatch.setattr(site, "WORTH_PROCESSES", 1)
    monkeypatch.setattr(site, "scenario_data", fails)
    with pytest.raises(RuntimeError, match="no page today"):
        site.build(results, rank(results), tmp_path / "site", workers=2)
    assert not list(tmp_path.iterdir())


def test_every_estimator_of_simnav_has_a_family():
    mine = [name for name in names() if comes_with_simnav(find(name))]
    assert len(mine) > 60
    facts = [estimator_facts(name) for name in mine]
    assert [f.summary for f in facts if f.family == "Other"] == []
    assert [f.summary for f in facts if "---" in f.text + f.source] == []  # no section of a docstring


def test_pages_link_to_documentation_and_repository_where_they_are_known(results, tmp_path, no_charts):
    home = Home("https://example.org/simnav", "../site-docs/index.html")
    mine = [r for r in results if r.scenario == SCENARIOS[0] and r.seed < 2 and r.status == "ok"]
    site.build(mine, rank(mine), tmp_path / "site", home=home)
    for page in pages(tmp_path / "site").values():
        assert {home.repository, home.documentation} <= set(page.links)
    docs = Path(__file__).parents[3] / "docs"
    linked = {link for page in pages(tmp_path / "site").values() for link in page.links if "site-docs" in link}
    assert "../site-docs/statistics.html" in linked
    assert [
        link for link in linked if not (docs / link.removeprefix("../site-docs/")).with_suffix(".md").exists()
    ] == []


def test_the_table_of_a_scenario_has_no_column_over_several(folder):
    keys = [c["key"] for c in data_of(folder / f"{SCENARIOS[0]}.html")["table"]["columns"]]
    assert "gain_interval" in keys
    assert not {"won", "gain_scenarios", "over_scenarios"} & set(keys)


def test_datasheets_of_any_instrument_are_words() -> None:
    """Processes of an error are tables in a list, and beacons have names."""
    for name in ("coloured-fixes", "satellites-harbour", "under-ice-transit"):
        scenario = load(name).model_copy(update={"duration": 2.0})
        found = {one["name"]: one["text"] for one in datasheets(scenario, record(scenario, 0))}
        assert set(found) == {*scenario.instruments, *(["imu"] if scenario.imu is not None else [])}
        assert not any("{" in text for text in found.values())
        if name == "coloured-fixes":
            assert "error (kind gauss_markov; correlation time" in found["gnss"]
