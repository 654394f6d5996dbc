"""The description of a run, checked, with the values that are drawn for each run."""

from __future__ import annotations

import hashlib
import json
import pickle
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self, SupportsIndex

from pydantic import PrivateAttr, model_validator

from simnav.plugins import is_file_module, load_plugin, source_digest
from simnav.scenario.consistency import check
from simnav.scenario.description import Description
from simnav.scenario.draws import Distribution, Draws, Template, has_draws, with_values
from simnav.spec import Spec, SpecError

__all__ = ["Scenario"]

#: Files with draws that were tried at the ends of their ranges in this process.
_CHECKED: set[str] = set()


class Scenario(Description):
    """The description of a run. It is simulated unless it has a ``[log]``.

    The fields carry their own descriptions (``Scenario.model_fields``) and hold SI units and radians;
    ``docs/reference/scenarios.md`` lists their TOML keys. Build one with `load` or `parse`, or from Python.
    """

    _template: Template | None = PrivateAttr(None)
    _declared: dict[str, Any] = PrivateAttr(default_factory=dict)
    _draws: Draws = PrivateAttr(default_factory=dict)

    def __repr__(self) -> str:
        return f"<Scenario: {self.id}, {self.title or 'without a title'}, {self.duration:g} s>"

    @classmethod
    def from_toml(
        cls, table: Mapping[str, Any], *, source: str = "<toml>", path: str = "", tried: bool = False
    ) -> Self:
        """See `Spec.from_toml`. With distributions, the result is the scenario in the middle of their ranges.

        Parameters
        ----------
        table, source, path
            See `Spec.from_toml`.
        tried : bool
            The scenario is known to be valid at the ends of its ranges, so that they are not tried again.

        Raises
        ------
        SpecError
            Also if the scenario is not valid for some of its draws; the message names them.
        """
        if not isinstance(table, Mapping) or not has_draws(table):
            return super().from_toml(table, source=source, path=path)
        template = Template(table, source)
        scenario = super().from_toml(template.middle(), source=source, path=path)
        content = f"{source} {json.dumps(template.table, default=str)}"
        for drawn, draws in () if tried or content in _CHECKED else template.extremes():
            try:
                super().from_toml(drawn, source=source, path=path)
            except SpecError as error:
                raise SpecError(f"{error} (for some draws: {_listed(draws)})") from None
        if not tried:
            _CHECKED.add(content)
        scenario._template = template
        scenario._declared = {name: getattr(scenario, name) for name in cls.model_fields}
        return scenario

    def to_toml(self) -> dict[str, Any]:
        """See `Spec.to_toml`. Distributions are written as they were given."""
        table = super().to_toml()
        if self._template is None:
            return table
        keys = {name: key for key, (name, _) in self.toml_keys().items()}
        kept = {keys[name] for name in self._declared if name not in self._replaced()} | {"draw"}
        return {
            **{k: v for k, v in table.items() if k not in kept},
            **{k: v for k, v in self._template.table.items() if k in kept},
        }

    @property
    def distributions(self) -> Mapping[str, Distribution]:
        """The distributions by key path; empty if every run has the same scenario."""
        return {} if self._template is None else self._template.distributions

    @property
    def draws(self) -> Mapping[str, Any]:
        """The values drawn for this run, by key path, in the units of the keys; empty before `drawn`."""
        return self._draws

    def drawn(self, seed: int) -> Self:
        """The scenario of one run, with all values drawn.

        Parameters
        ----------
        seed : int
            Seed of the run.

        Returns
        -------
        Scenario
            The scenario itself if it has no distributions. A field that was replaced in Python (``model_copy``) is
            kept.
        """
        if self._template is None:
            return self
        table, draws = self._template.drawn(self.root(seed))
        scenario = super().from_toml(table, source=self._template.source)
        replaced = self._replaced()
        if replaced:
            scenario = scenario.model_copy(update=replaced)
        scenario._draws = draws
        return scenario

    def extremes(self) -> list[Self]:
        """The scenario in the middle of its ranges, and what it becomes at their ends."""
        if self._template is None:
            return [self]
        replaced = self._replaced()
        source = self._template.source
        found = [super(Scenario, self).from_toml(table, source=source) for table, _ in self._template.extremes()]
        return [self, *(s.model_copy(update=replaced) for s in found)]

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """The scenario with other values at some keys of its TOML, whether they were drawn or not.

        Parameters
        ----------
        values : mapping
            Key path, like ``fault[0].sigma_m`` or ``draw.length``, to a value in the unit of the key.

        Raises
        ------
        SpecError
            If a path leads nowhere, or the scenario is not valid with these values.
        """
        source = f"scenario {self.id}"
        return type(self).from_toml(with_values(self.to_toml(), values, source), source=source)

    def _replaced(self) -> dict[str, Any]:
        """Fields that are not as the template has them."""
        return {name: getattr(self, name) for name, value in self._declared.items() if getattr(self, name) != value}

    def content_hash(self) -> str:
        """Hexadecimal digest of everything that decides the numbers of a run, defaults included.

        Title, description, source, tags, track, group and dials are not included, nor are the files of a log. The
        files of a vessel and of the surroundings are included by their content, not by their paths.
        Distributions are included as they are written.
        """
        words = {"title", "description", "source", "tags", "track", "group", "plugins", "dials"}
        if not self.surroundings:
            words.add("surroundings")
        content = self.model_dump(mode="python", exclude=words)
        for name in self.craft.files:
            content["vessel"][name] = _digest(getattr(self.craft, name))
        for part, spec in self.surroundings.items():
            for name in spec.files:
                file = getattr(spec, name)
                if file or name not in spec.later:
                    content["surroundings"][part][name] = file and _digest(file)
        if self._template is not None:
            content["distributions"] = _canonical(self._template.table, words)
        # Not sorted: the order of the instruments is the order in which simultaneous measurements are handed over.
        digest = hashlib.blake2b(json.dumps(content, default=str).encode(), digest_size=16)
        for module in sorted({type(spec).__module__ for spec in self._registered()}):
            if not module.startswith("simnav."):  # what the code of others does is not in simnav's version
                digest.update(source_digest(module).encode())
        return digest.hexdigest()

    def _registered(self) -> list[Spec]:
        """The parts of the scenario whose classes are registered, by simnav or by others."""
        processes = [process for spec in self.aids.values() for process in spec.processes]
        return [*self.instruments.values(), *processes, *self.faults, *self.surroundings.values(), self.craft]

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        """Pickle for another process, which must load the plug-in files before it can build their instruments."""
        names = [type(spec).__module__ for spec in self._registered()]
        files = [sys.modules[name].__file__ for name in names if is_file_module(name) and name in sys.modules]
        reduced = super().__reduce_ex__(protocol)
        plugins = tuple(dict.fromkeys((*self.plugins, *filter(None, files))))
        return (_restore, (plugins, pickle.dumps(reduced))) if plugins else reduced

    @model_validator(mode="after")
    def _check(self) -> Self:
        check(self)
        return self


def _digest(path: str) -> str:
    """Hexadecimal digest of a file; SpecError if it cannot be read."""
    try:
        return hashlib.blake2b(Path(path).read_bytes(), digest_size=16).hexdigest()
    except OSError as error:
        raise SpecError(f"vessel: the file {path!r} cannot be read: {error.strerror}") from None


def _listed(draws: Draws) -> str:
    """A few draws, for a message."""
    shown = [
        f"{key} = {value:.6g}" if isinstance(value, float) else f"{key} = {value!r}" for key, value in draws.items()
    ]
    return ", ".join(shown[:8]) + (", ..." if len(shown) > 8 else "")


def _canonical(table: Mapping[str, Any], words: set[str]) -> dict[str, Any]:
    """What is to be drawn: the tables of a scenario file in which there is a distribution, a reference or a name."""
    found = {
        key: value for key, value in table.items() if key not in words and (key == "draw" or has_draws({key: value}))
    }
    sea = found.get("sea")
    if isinstance(sea, Mapping) and isinstance(sea.get("spectrum_end"), float):
        # A key that came later. As a plain number it counts with the fields of the sea.
        found["sea"] = {key: value for key, value in sea.items() if key != "spectrum_end"}
    return found


def _restore(plugins: tuple[str, ...], reduced: bytes) -> Any:
    """A pickled scenario with plug-in files."""
    for path in plugins:
        load_plugin(path)
    function, arguments, state, *_ = pickle.loads(reduced)
    scenario = function(*arguments)
    scenario.__setstate__(state)
    return scenario
