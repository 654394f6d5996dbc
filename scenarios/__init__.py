"""The catalogue of scenarios: one TOML file each, found by `simnav.scenario.catalogue` through the entry-point group
``simnav.scenarios``. ``docs/reference/scenarios.md`` describes the schema."""

from __future__ import annotations

__all__: list[str] = []
