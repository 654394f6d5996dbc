"""Sweeps on the site: error against a dial of a scenario, and where each estimator breaks.

``simnav sweep`` leaves what it found as ``sweep-DIAL.json`` in the folder of its results; the page of the scenario
shows it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.former_names import present_label
from simnav.leaderboard.results.plain import as_json
from simnav.leaderboard.sweep.report import Sweep

from .charts import Chart, columns, dial
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

    def section(self, number: int) -> dict[str, Any]:
        """What the page shows of it: a chart where one dial was turned, and the breaking points."""
        dials, score = self.content["dials"], self.content["score"]
        titles = [_title(d) for d in dials]
        breaking = list(self.content["breaking_points"])
        return {
            "title": " and ".join(titles),
            "charts": [self._chart(f"dial-{number}", titles[0], breaking).to_dict()] if len(dials) == 1 else [],
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
                    "beyond": dials[0]["values"][-1],
                }
                for b in breaking
            ],
        }

    def _chart(self, name: str, across: str, breaking: Sequence[Mapping[str, Any]]) -> Chart:
        score, points = self.content["score"], self.content["points"]
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
        unit = "" if score["unit"] == "-" else f" [{score['unit']}]"
        runs = max((p["error"]["runs"] for p in points), default=0)
        data = {"curves": {"rows": curves}, "marks": {"rows": marks}}
        known = any(short(p["error"]["low"]) is not None for p in points)
        band = " with its 95 % interval" if known else ""
        return dial(name, across, f"{score['title']}{unit}", data, f"Median of {runs} runs{band}.")


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
