"""Charts of the site, drawn by the library itself, without a browser."""

from __future__ import annotations

import re

import numpy as np
import pytest

from simnav.leaderboard.figures import appearance, style
from simnav.leaderboard.site import charts, dial_charts, labels, print_figures
from simnav.leaderboard.site.library import VEGA_LITE
from simnav.leaderboard.site.pages import TEMPLATES
from simnav.leaderboard.site.print_figures import filled

FONT = 11
#: Names of two points that are far from each other.
AS_USUAL = {"shift": [-4.0, -4.0], "shift_narrow": [-4.0, -4.0]}


def names_of(chart: charts.Chart, width: int) -> dict[str, tuple[str, float, float]]:
    """Anchor and place of the names beside the points, from the upper left corner of the axes."""
    import vl_convert

    svg = vl_convert.vegalite_to_svg(filled(chart, (), width), vl_version=VEGA_LITE)
    place = r'text-anchor="(\w+)" transform="translate\(([-\d.]+),([-\d.]+)\)"'
    pattern = rf"<text [^>]*{place}[^>]*>(first-\w+|last-\w+)</text>"
    return {name: (anchor, float(x), float(y)) for anchor, x, y, name in re.findall(pattern, svg)}


@pytest.mark.parametrize("width", [300, 620])
def test_names_beside_the_points_stay_within_the_axes(width: int) -> None:
    front = {"row": ["first-row", "last-row"], "front": [True, True], **AS_USUAL}
    cost = charts.accuracy_and_cost(
        "cost",
        "Score",
        "ekf",
        {
            "rows": front
            | {"low": [1.5, 2.3], "high": [1.5, 2.3], "cost": [1.5, 2.3], "error": [12.4, 9.7], "family": ["a", "b"]}
        },
    )
    detection = charts.detection("detection", {"rows": front | {"false": [1.0, 9.0], "found": [50.0, 90.0]}})
    for chart in (cost, detection):
        found = names_of(chart, width)
        assert found["first-row"][0] == "start"
        assert found["last-row"][0] == "end"
        for _, x, y in found.values():
            assert 0.0 < x < width
            assert y > 1.2 * FONT  # the text stands above this line


@pytest.mark.parametrize("width", [300, 620])
def test_names_of_points_at_one_place_stand_apart(width: int) -> None:
    names = [f"first-row{k}" for k in range(5)] + ["last-row"]
    costs, errors, shown = [*np.linspace(1.0, 1.02, 5), 30.0], [*np.linspace(2.02, 2.0, 5), 1.0], [True] * 6
    rows = {"row": names, "front": shown, "cost": costs, "low": costs, "high": costs, "error": errors, "family": names}
    rows |= labels.shifts(names, costs, errors, shown, charts.COST_HEIGHT)
    found = names_of(charts.accuracy_and_cost("cost", "Score", "ekf", {"rows": rows}), width)
    heights = sorted(y for name, (_, _, y) in found.items() if name.startswith("first"))
    assert len(heights) == 5
    assert min(np.diff(heights)) > FONT
    assert min(heights) > FONT


def test_a_map_of_two_dials_names_the_cells_that_fail() -> None:
    cells = {"x": [1.0, 2.0], "y": [0.0, 0.0], "error": [1.5, None], "text": ["1.5", "fails"], "dark": [False, False]}
    chart = dial_charts.dial_map("map", "Jump [m]", "Outage [s]", "RMSE [m]", {"curves": {"rows": {"ekf": cells}}}, "")
    import vl_convert

    svg = vl_convert.vegalite_to_svg(filled(chart, ["ekf"]), vl_version=VEGA_LITE)
    assert {"1.5", "fails"} <= set(re.findall(r">([^<]+)</text>", svg))
    assert len(re.findall(r'aria-roledescription="rect mark"', svg)) == 2


def test_a_long_name_in_the_middle_is_not_cut() -> None:
    front = {"row": ["first-row", "last-" + "x" * 40], "front": [True, True], "family": ["a", "b"], **AS_USUAL}
    chart = charts.accuracy_and_cost(
        "cost",
        "Score",
        "ekf",
        {"rows": front | {"low": [0.99, 1.0], "high": [1.01, 1.02], "cost": [1.0, 1.01], "error": [3.0, 2.0]}},
    )
    assert names_of(chart, 620)["last-" + "x" * 40][0] == "end"


def test_scripts_of_the_site_have_no_colours_of_rows_of_their_own() -> None:
    """Colours, lines and inks of all charts are in one file, which the site hands to the browser."""
    text = (TEMPLATES / "charts.js").read_text()
    assert text.count("$APPEARANCE") == 1
    told = appearance.for_browser()
    for light, dark in appearance.PALETTE:
        assert light not in text
        assert dark not in text
    assert told["palettes"]["light"][0] == style.PALETTE[0][0] == print_figures._INKS["$strong"]
    assert {*told["inks"]} == {*told["palettes"]} == {"light", "dark"}
    assert len(told["dashes"]) == len(appearance.LINES)
