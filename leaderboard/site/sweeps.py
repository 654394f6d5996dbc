"""Sweeps on the site: error against a dial of a scenario, and where each estimator breaks.

``simnav sweep`` leaves what it found as ``sweep-DIAL.json`` in the folder of its results; the page of the scenario
shows it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.former_names import present_label
from simnav.leaderboard.results.plain import as_json
from simnav.leaderboard.sweep.report import Sweep

from .charts import Chart, columns
from .dial_charts import at_value, dial, dial_map
from .rounding import short

__all__ = ["SweepFile", "sweeps_in", "write"]


@dataclass(frozen=True)
class SweepFile:
    """What one sweep found.

    Attributes
    ----------
    path : Path
        Path of the file.
    content : dict
        As from `Sweep.to_dict`.
    """

    path: Path
    content: dict[str, Any]

    @property
    def scenario(self) -> str:
        """Versioned id."""
        return str(self.content["scenario"])

    @property
    def rows(self) -> list[str]:
        """Labels of the estimators."""
        return list(dict.fromkeys(str(p["estimator"]) for p in self.content["points"]))

    def only(self, estimators: Collection[str]) -> SweepFile:
        """The same sweep with some of its estimators."""
        parts = ("points", "breaking_points")
        return SweepFile(
            self.path,
            self.content | {k: [e for e in self.content[k] if e["estimator"] in estimators] for k in parts},
        )

    def section(self, number: int) -> dict[str, Any]:
        """What the page shows of it: charts of one dial, with a slider, or a map of two; and the breaking points."""
        dials, score = self.content["dials"], self.content["score"]
        titles = [_title(d) for d in dials]
        breaking = list(self.content["breaking_points"])
        error = score["title"] + ("" if score["unit"] == "-" else f" [{score['unit']}]")
        if len(dials) == 1:
            caption = "Point and line: median with its 95 % interval. The slider above chooses the value."
            made = [self._chart(f"dial-{number}", titles[0], error, breaking),
                    at_value(f"dial-{number}-at", dials[0]["title"], error, self._ends(), caption)]  # fmt: skip
        else:
            made = [self._map(f"dial-{number}", titles, error)]
        return {
            "title": " and ".join(titles),
            "charts": [chart.to_dict() for chart in made],
            "values": list(dials[0]["values"]) if len(dials) == 1 else [],
            "dial": {"title": dials[0]["title"], "unit": dials[0]["unit"]},
            "rows": self.rows,
            "second": titles[1] if len(dials) == 2 else "",
            "unit": score["unit"],
            "breaking": [
                {
                    "name": b["estimator"],
                    "at": b["at"],
                    "passes": "twice its clean error" if b["criterion"] == "twice-clean" else "the limit",
                    "threshold": short(b["threshold"]),
                    "value": short(b["value"]["value"]),
                    "low": short(b["value"]["low"]),
                    "high": short(b["value"]["high"]),
                    "beyond": self.content.get("beyond", dials[0]["values"][-1]),
                }
                for b in breaking
            ],
        }

    def _chart(self, name: str, across: str, up: str, breaking: Sequence[Mapping[str, Any]]) -> Chart:
        points = self.content["points"]
        rows: dict[str, list[Any]] = {row: [] for row in self.rows}
        for p in points:
            error = (short(p["error"][key]) for key in ("value", "low", "high"))
            rows[p["estimator"]].append((p["values"][0], *error, p["failed"]))
        curves = {row: columns(("value", "middle", "low", "high", "failed"), of) for row, of in rows.items()}
        marks = {
            b["estimator"]: {"at": [short(b["value"]["value"])], "threshold": [short(b["threshold"])]}
            for b in breaking
            if b["criterion"] == "twice-clean" and b["value"]["value"] is not None
        }
        runs = max((p["error"]["runs"] for p in points), default=0)
        data = {"curves": {"rows": curves}, "marks": {"rows": marks}}
        known = any(short(p["error"]["low"]) is not None for p in points)
        band = " with its 95 % interval" if known else ""
        return dial(name, across, up, data, f"Median of {runs} runs{band}.")

    def _ends(self) -> list[float]:
        """The smallest and the largest figure of all points; empty where all fail."""
        keys = ("value", "low", "high")
        found = [x for p in self.content["points"] for key in keys if (x := short(p["error"][key])) and x > 0.0]
        return [min(found), max(found)] if found and min(found) < max(found) else []

    def _map(self, name: str, titles: Sequence[str], label: str) -> Chart:
        """The cells of all panels have one scale of colours."""
        points = self.content["points"]
        logs = [math.log(e) for p in points if (e := short(p["error"]["value"])) is not None and e > 0.0]
        middle = 0.5 * (min(logs) + max(logs)) if logs else 0.0
        rows: dict[str, list[Any]] = {row: [] for row in self.rows}
        for p in points:
            error = short(p["error"]["value"])
            dark = error is not None and error > 0.0 and math.log(error) > middle
            text = "fails" if error is None else tables.number(error)
            rows[p["estimator"]].append((*p["values"], error, text, dark))
        cells = {row: columns(("x", "y", "error", "text", "dark"), of) for row, of in rows.items()}
        runs = max((p["error"]["runs"] for p in points), default=0)
        words = f"Median of {runs} runs at each pair of values. Grey: half of the runs fail or more."
        return dial_map(name, titles[0], titles[1], label, {"curves": {"rows": cells}}, words)


def _title(values: Mapping[str, Any]) -> str:
    return f"{values['title']} [{values['unit']}]" if values["unit"] else str(values["title"])


def write(sweep: Sweep) -> Path:
    """Leave what a sweep found in the folder of its results."""
    name = "-".join(d.name if d.name != "value" else d.key for d in sweep.dials)
    safe = "".join(c if c.isalnum() or c in "-_" else "-" for c in name)
    content = json.dumps(as_json(sweep.to_dict()), indent=1, allow_nan=False)
    return write_whole(sweep.summary.folder / f"sweep-{safe}.json", content + "\n")


def sweeps_in(folder: Path) -> list[SweepFile]:
    """What sweeps left in the folders inside a folder.

    Raises
    ------
    RequestError
        If a file is damaged.
    """
    found = []
    for path in sorted(folder.glob("*/sweep-*.json")):
        try:
            content = json.loads(path.read_bytes())
            for entry in (*content["points"], *content["breaking_points"]):
                entry["estimator"] = present_label(str(entry["estimator"]))
            one = SweepFile(path, content)
            one.section(0)
        except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
            raise RequestError(f"{path} is not what 'simnav sweep' writes; run the sweep again ({error!r})") from None
        found.append(one)
    return found
