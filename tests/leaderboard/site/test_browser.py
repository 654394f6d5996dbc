"""The site in a browser: headless Chromium, from disk, without a network, on a screen and on a phone."""

from __future__ import annotations

import csv
import io
import math
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.statistics import separate
from simnav.leaderboard.site import site

playwright = pytest.importorskip("playwright.sync_api", reason="the package playwright is not installed")

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="there is no Chromium on this machine: apt-get install chromium"
)

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
SCREEN, PHONE = 1400, 390
#: What a chart draws of its data.
MARKS = ", ".join(f"g.mark-{kind}.role-mark path[d]:not([d=''])" for kind in ("symbol", "line", "rect", "area", "arc"))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as engine:
        found = engine.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield found
        found.close()


class Visit:
    """A tab of the browser; an error or a warning on its console is a failure."""

    def __init__(self, browser: Any, folder: Path, width: int = SCREEN, scheme: str = "light"):
        self.folder = folder
        self.context = browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True, accept_downloads=True
        )
        self.page = self.context.new_page()
        self.page.set_default_timeout(10_000)
        self.complaints: list[str] = []
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda e: self.complaints.append(str(e)))

    def open(self, name: str) -> Any:
        self.page.goto("about:blank")  # so that a new fragment loads the page again
        self.page.goto(f"{(self.folder / name.partition('#')[0]).as_uri()}{''.join(name.partition('#')[1:])}")
        self.page.wait_for_selector("body[data-ready]")
        return self.page

    def names(self, within: str = ".track:not([hidden]) [data-table]") -> list[str]:
        """What stands in the first column of names, row by row."""
        cells = self.page.query_selector_all(f"{within} tbody th")
        return [c.evaluate("c => (c.querySelector('a') ?? c).textContent.trim()") for c in cells]

    def close(self) -> None:
        self.context.close()
        assert self.complaints == []


@pytest.fixture
def visit(browser: Any, folder: Path) -> Iterator[Visit]:
    made = Visit(browser, folder)
    yield made
    made.close()


def chart(page: Any, name: str) -> Any:
    """A chart, drawn."""
    page.locator(f"#chart-{name}").scroll_into_view_if_needed()
    return page.wait_for_selector(f"#chart-{name} .vega[data-drawn] svg")


BOARD = "board-other-scenarios.html"
PAGES = (
    "index.html",
    BOARD,
    "{scenario}.html",
    "made-up-two-v3.html",
    "estimator-sw-fgo.html",
    "compare.html",
    "about.html",
)


@pytest.mark.parametrize(("width", "scheme"), [(SCREEN, "light"), (PHONE, "dark")])
def test_every_kind_of_page_fits_and_draws_all_charts(browser, folder, catalogued, width, scheme):
    visit = Visit(browser, folder, width, scheme)
    for name in PAGES:
        page = visit.open(name.format(scenario=catalogued))
        assert page.evaluate("document.documentElement.scrollWidth") == width, name
        for place in page.query_selector_all(".track:not([hidden]) figure.chart, section > .charts > figure.chart"):
            drawn = chart(page, place.get_attribute("id").removeprefix("chart-"))
            box = drawn.bounding_box()
            assert box["width"] <= width
            assert box["height"] > 40
            assert drawn.query_selector(MARKS), f"{name}: {place.get_attribute('id')} is empty"
        text = page.evaluate("getComputedStyle(document.body).color")
        assert (sum(map(int, text[4:-1].split(","))) > 384) == (scheme == "dark")
    visit.close()


def test_the_overview_opens_quickly_without_the_chart_library(browser, folder):
    """The library is read when the first chart comes into view; the table does not wait for it."""
    visit = Visit(browser, folder, PHONE)
    visit.context.route("**/vega.js", lambda route: route.abort())
    page = visit.open("index.html")
    assert page.locator(".picture tbody tr").count() == 4  # one kind of trouble, all, time, honesty
    assert page.locator(".headings a").count() == 1
    loaded = page.evaluate("performance.getEntriesByType('navigation')[0].domContentLoadedEventEnd")
    assert loaded < 1000.0 * 3  # a second on an idle machine; tests share theirs
    page = visit.open(BOARD)
    assert len(visit.names()) > 2
    assert not page.is_visible("[role=tablist]")  # tracks are chosen in a list
    page.select_option("select[data-tracks]", "fjords")
    page.wait_for_selector("#track-fjords tbody tr")
    assert "track=fjords" in page.url
    assert page.is_hidden(".track:not(#track-fjords)")
    visit.context.close()


def test_three_boxes_choose_a_row_and_say_where_there_is_no_evidence(visit):
    page = visit.open("index.html")
    boxes = page.locator("[data-advisor] select")
    assert boxes.count() == 3
    assert "take `" not in page.inner_text("[data-answer]")
    assert "With fixes noisy or jumping, take " in page.inner_text("[data-answer]")
    boxes.nth(1).select_option("imu")
    assert page.inner_text("[data-answer] .verdict").startswith("No evidence: ")
    boxes.nth(1).select_option("noisy-fixes")
    boxes.nth(2).select_option("4")
    assert page.inner_text("[data-answer] pre").endswith("--trouble noisy-fixes --milliseconds 0.1")
    address = page.url.partition("#")[2]
    page = visit.open(f"index.html#{address}")
    assert page.input_value("[data-advisor] select >> nth=1") == "noisy-fixes"


def test_runs_that_are_lost_against_the_plain_ekf_are_listed_and_lead_to_the_run(visit, hostile):
    rows = visit.open("compare.html").evaluate("simnav.page.rows")
    page = visit.open(rows[hostile]["page"])
    assert "On 33 of 36 runs its error is more than 1.5 times that of ekf" in page.inner_text("body")
    assert "on 3 it failed" in page.inner_text("body")
    assert len(visit.names("[data-losses]")) == 25
    page.click("[data-losses] tbody tr:first-child th a")
    page.wait_for_selector("body[data-ready]")
    assert "row=" in page.evaluate("location.hash")
    assert page.evaluate("[simnav.write.ratio(1000), simnav.write.ratio(900)]") == ["failed", "900"]


def test_tables_sort_filter_and_search_and_the_address_keeps_it(visit, hostile):
    page = visit.open(f"{BOARD}#track=other")
    assert visit.names() == ["sw-fgo", "ekf", hostile, "inertial", "oracle"]
    page.click(".track:not([hidden]) [data-table] th[data-key=cost] button")
    assert visit.names()[-1] == hostile  # its cost was not measured
    assert page.get_attribute(".track:not([hidden]) [data-table] th[data-key=cost]", "aria-sort") == "ascending"
    page.click(".track:not([hidden]) [data-table] th[data-key=cost] button")
    assert page.get_attribute(".track:not([hidden]) [data-table] th[data-key=cost]", "aria-sort") == "descending"
    descending = visit.names()
    panel = page.locator(".track:not([hidden]) [data-table]")
    panel.locator("select[aria-label='Only Family']").select_option("Factor graph")
    assert visit.names() == ["sw-fgo"]
    panel.locator("summary").click()
    panel.get_by_label("Worst run").check()
    address = page.url.partition("#")[2]
    assert {"track=other", "other.sort=-cost", "other.family=Factor+graph"} <= set(address.split("&"))
    page = visit.open(f"{BOARD}#{address}")
    assert visit.names() == ["sw-fgo"]
    assert page.query_selector("#track-other th[data-key=worst]") is not None
    page.locator("#track-other [data-table] select").select_option("")
    assert visit.names() == descending
    page.locator("#track-other [data-table] input[type=search]").fill("sliding window")
    assert visit.names() == ["sw-fgo"]  # found by its description
    assert "1 of 5 rows" in page.inner_text("#track-other [data-table] [role=status]")


def test_tabs_are_chosen_by_keyboard_and_link(visit):
    page = visit.open(BOARD)
    tabs = page.get_by_role("tab")
    first = tabs.nth(0)
    first.focus()
    page.keyboard.press("ArrowRight")
    assert tabs.nth(1).get_attribute("aria-selected") == "true"
    assert page.evaluate("document.activeElement.getAttribute('role')") == "tab"
    assert page.locator(".track:not([hidden])").count() == 1
    assert "track=fjords" in page.url


def test_headings_and_charts_explain_themselves_on_hover(visit, catalogued):
    page = visit.open(f"{BOARD}#track=other")
    page.hover("#track-other [data-table] th[data-key=ranks] button")
    assert "cannot be told apart" in page.inner_text("#tip")
    page.mouse.move(0, 0)
    page.focus("#track-other [data-table] th[data-key=coverage] button")
    assert "95 % ellipse" in page.inner_text("#tip")
    page = visit.open(f"{catalogued}.html")
    drawn = chart(page, "rmse")
    drawn.query_selector_all("g.mark-symbol path")[0].hover(force=True)
    page.wait_for_selector("#vg-tooltip-element.visible")
    assert "Horizontal RMSE" in page.inner_text("#vg-tooltip-element")


def test_rows_of_charts_are_switched_on_and_off(visit, catalogued):
    page = visit.open(f"{catalogued}.html")

    def curves() -> int:
        chart(page, "horizontal")
        page.wait_for_timeout(300)
        return len(page.query_selector_all("#chart-horizontal svg g.mark-line path[stroke]"))

    before = curves()
    page.click(".chip[data-row=ekf]")
    assert curves() == before - 1
    page.locator("[data-rows] select").select_option("oracle")
    assert curves() == before
    assert "oracle" in page.url
    assert "ekf" not in page.evaluate("new URLSearchParams(location.hash.slice(1)).get('rows').split('|')")


def test_a_page_is_printed_with_all_its_charts_in_the_colours_of_paper(browser, folder, catalogued):
    visit = Visit(browser, folder, scheme="dark")
    page = visit.open(f"{catalogued}.html")
    charts = "document.querySelector('[data-charts]').cloneNode(true)"
    page.evaluate(f"window.print = () => {{ window.printed = {charts}; }}; 0")
    page.click("[data-print]")
    page.wait_for_function("window.printed")
    assert page.evaluate("[...printed.querySelectorAll('.vega')].every((v) => v.dataset.drawn)")
    ink = "printed.querySelector('.role-axis-title text').getAttribute('fill')"
    assert page.evaluate(ink) == "#1b2430"
    page.emulate_media(media="print")
    assert page.locator(".rowswitch .chip").first.is_visible()  # or nobody knows which curve is which
    visit.close()


def test_where_no_curves_are_kept_the_charts_say_so(browser, results, tmp_path, catalogued):
    few = [replace(r, series={}) for r in results]
    site.build(few, rank(few), tmp_path / "site")
    visit = Visit(browser, tmp_path / "site")
    page = visit.open(f"{catalogued}.html")
    assert page.get_by_text("Curves over time are kept of 0 of the").is_visible()
    assert page.locator(".rowswitch .chip").count() == 0
    page.locator("[data-run]").scroll_into_view_if_needed()
    page.locator("#chart-run-horizontal").scroll_into_view_if_needed()
    page.wait_for_selector("#chart-run-horizontal .vega.none")
    assert page.inner_text("#chart-run-horizontal .vega") == "Curves of these rows are not kept."
    chart(page, "track")
    visit.close()


def test_one_run_has_its_track_and_the_command_that_repeats_it(visit, catalogued):
    page = visit.open(f"{catalogued}.html#row=sw-fgo&seed=0")
    page.locator("[data-run]").scroll_into_view_if_needed()
    chart(page, "track")
    assert page.locator(".drawn td").all_text_contents() == ["3.50", "dvl"]
    page.get_by_text("Innovations, residuals and weights of this run").click()
    chart(page, "run-weight-gnss")
    page.get_by_text("Weights of the measurements").click()
    chart(page, "weight-gnss")
    assert page.inner_text("[data-run] pre") == f"simnav run {catalogued} --seed 0 -e sw-fgo --plot run.svg"
    other = next(s for s in range(1, 12) if s not in page.evaluate("simnav.page.runs.seeds"))
    page.locator("[data-run] select[aria-label=Run]").select_option(str(other))
    page.wait_for_function(f"document.querySelector('[data-run] pre').textContent.includes('--seed {other} ')")
    assert page.locator("[data-run] .charts").first.is_hidden()
    assert page.locator(".drawn").is_hidden()
    page.get_by_text("All runs of this estimator").click()
    assert len(visit.names("[data-run] details:last-child")) == 12


def paired(results, a: str, b: str) -> dict[str, list[float]]:
    by = {(r.scenario, r.seed, r.estimator): r.scores["horizontal_rmse"] for r in results if r.status == "ok"}
    found: dict[str, list[float]] = {}
    for (scenario, seed, label), value in by.items():
        if label == a and (scenario, seed, b) in by:
            found.setdefault(scenario, []).append(math.log(value / by[scenario, seed, b]))
    return found


def test_two_rows_are_compared_run_by_run(visit, results):
    """Against the same figures in Python; the p-value against all flips of the signs."""
    page = visit.open("compare.html#a=sw-fgo&b=ekf")
    page.wait_for_selector("[data-table] tbody tr")
    found = paired(results, "sw-fgo", "ekf")
    ratio = math.exp(sum(sum(d) / len(d) for d in found.values()) / len(found))
    text = page.inner_text("[data-verdict]")
    assert f"{sum(map(len, found.values()))} runs" in text
    assert f"{100 * (1 - ratio):.3g} % smaller" in text
    chart(page, "pairs")
    rows = page.evaluate(
        "Object.fromEntries(simnav.tables.main.given.rows.map((r) => [r.scenario, [r.ratio, r.p, r.wins]]))"
    )
    for scenario, differences in found.items():
        n = len(differences)
        assert rows[scenario][0] == pytest.approx(math.exp(sum(differences) / n), rel=1e-3)
        assert rows[scenario][2] == pytest.approx(sum(d < 0 for d in differences) / n)
        values = np.column_stack([differences, np.zeros(n)])
        assert rows[scenario][1] == pytest.approx(separate(values).p_values[0, 1], abs=0.02)
    page.click("text=Swap")
    page.wait_for_function("document.querySelector('[data-verdict]').textContent.includes('of ekf is')")
    assert "larger" in page.inner_text("[data-verdict]")
    assert "a=ekf" in page.url
    page.select_option("[data-tracks] select", "other")
    page.wait_for_function("simnav.charts.wins?.given.data.cells.page[0].includes('track=other')")
    chart(page, "wins")
    share = page.evaluate("simnav.charts.wins.given.data.cells")
    cells = list(zip(share["row"], share["other"], strict=True))
    at = cells.index(("sw-fgo", "ekf"))
    assert share["share"][at] + share["share"][cells.index(("ekf", "sw-fgo"))] == pytest.approx(100.0)
    page.locator("#chart-wins .mark-rect path").nth(at).click()
    page.wait_for_function("document.querySelector('[data-verdict]').textContent.includes('of sw-fgo is')")


def test_p_values_in_the_browser_are_those_of_the_board(visit):
    page = visit.open("compare.html")
    rng = np.random.default_rng(3)
    for centre, scenarios in ((0.0, 1), (0.1, 1), (0.25, 1), (0.08, 3)):
        x = rng.normal(centre, 0.3, (scenarios, 24))
        given = [{"runs": [{"run": k, "difference": d} for k, d in enumerate(row.tolist())]} for row in x]
        found = page.evaluate("(given) => simnav.pvalue(given)", given)
        strata, seeds = np.repeat(np.arange(scenarios), 24), np.tile(np.arange(24), scenarios)
        board = separate(np.column_stack([x.ravel(), np.zeros(x.size)]), strata, seeds)
        assert found == pytest.approx(board.p_values[0, 1], abs=0.03)
    few = [{"runs": [{"run": k, "difference": 1.0} for k in range(5)]}]
    assert page.evaluate("(given) => simnav.pvalue(given)", few) is None


def test_weights_of_scenarios_move_the_places(visit):
    page = visit.open(f"{BOARD}#track=other")
    table = "#track-other [data-weights]"
    page.locator(f"{table} input[type=number]").nth(0).scroll_into_view_if_needed()
    scores = page.evaluate("simnav.page.tracks.find((t) => t.key === 'other').ratios")
    page.locator(f"{table} input[type=number]").nth(0).fill("0")
    expected = sorted(scores, key=lambda row: scores[row]["made-up-two-v3"])
    assert visit.names(table) == expected
    assert "other.weights=0%2C1" in page.url


def test_every_table_is_written_as_csv_and_latex(visit, hostile):
    page = visit.open(f"{BOARD}#track=other")
    panel = page.locator("#track-other [data-table]")
    with page.expect_download() as waiting:
        panel.get_by_role("button", name="CSV").click()
    rows = list(csv.DictReader(io.StringIO(Path(waiting.value.path()).read_text())))
    assert [row["Estimator"] for row in rows] == visit.names()
    assert rows[2]["Estimator"] == hostile
    assert float(rows[0]["× oracle"]) > 1.0
    with page.expect_download() as waiting:
        panel.get_by_role("button", name="LaTeX").click()
    text = Path(waiting.value.path()).read_text()
    assert waiting.value.suggested_filename.endswith(".tex")
    assert text.count("\\\\") == len(rows) + 1
    assert "\\{\\{ 7 * 7 \\}\\}" in text
    assert "simnav-bench 1.0" in text  # where the table comes from


def test_header_and_names_stay_in_view_on_a_phone(browser, folder):
    visit = Visit(browser, folder, PHONE)
    page = visit.open(f"{BOARD}#track=other")
    scroll = page.locator("#track-other [data-table] .scroll")
    scroll.evaluate("s => { s.scrollLeft = 300; }")
    page.locator("#track-other [data-table] tbody th").first.scroll_into_view_if_needed()
    left = scroll.bounding_box()["x"]
    name = page.locator("#track-other [data-table] tbody th").first.bounding_box()
    assert abs(name["x"] - left) < 12
    covering = page.evaluate(
        f"document.elementFromPoint({name['x'] + 20}, {name['y'] + name['height'] / 2}).closest('th, td').tagName"
    )
    assert covering == "TH"  # nothing lies over the name
    visit.close()


def test_links_lead_somewhere(visit):
    page = visit.open(f"{BOARD}#track=other")
    page.locator("#track-other [data-table]").get_by_role("link", name="sw-fgo").click()
    page.wait_for_selector("body[data-ready]")
    assert page.inner_text("h1") == "sw-fgo"
    page.get_by_role("link", name="All runs").click()
    page.wait_for_selector("[data-table] tbody tr")
    assert "sw-fgo" in page.inner_text("[data-verdict]")
    page.locator("[data-table]").get_by_role("link").first.click()
    page.wait_for_selector("body[data-ready]")
    assert page.evaluate("simnav.page.kind") == "scenario"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_has_no_serious_finding(browser, folder, catalogued, scheme):
    """All rules in light colours, contrast in dark ones, of which two pages have all."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not installed").Axe()
    options: dict[str, Any] = {"preload": False}  # it would read the style sheet again, which a file cannot be
    if scheme == "dark":
        options["runOnly"] = ["color-contrast"]
    visit = Visit(browser, folder, scheme=scheme)
    every = (
        "index.html",
        "board-other-scenarios.html",
        "{scenario}.html",
        "estimator-sw-fgo.html",
        "compare.html",
        "about.html",
    )
    for name in every if scheme == "light" else every[:2]:
        page = visit.open(name.format(scenario=catalogued))
        for drawn in page.query_selector_all(".track:not([hidden]) figure.chart")[:2]:
            chart(page, drawn.get_attribute("id").removeprefix("chart-"))
        # One page with the inside of its charts, which are many elements of few kinds, and take long.
        context = None if name == "compare.html" else {"exclude": [[".vega svg"]]}
        found = [
            (v["id"], v["nodes"][0]["html"][:200], v["nodes"][0]["failureSummary"][:300])
            for v in axe.run(page, context=context, options=options).response["violations"]
            if v["impact"] in ("serious", "critical")
        ]
        assert found == [], name
    visit.close()
