"""From the file of a paper (`simnav.leaderboard.papers.paper_file`) to the paper."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from simnav.spec import SpecError, closest

from . import FOLDER, key_of
from .measures import measure
from .paper import ERROR_LABELS, Figure, Gain, Method, Paper, Range, Row, Table, Value
from .paper_file import Cells, FigureEntry, Names, PaperFile, Printed, Reasons, Rows, TableEntry

__all__ = ["file_of", "paper_of"]

_RANGE = re.compile(r"(\S+) to (\S+)")


def paper_of(name: str) -> Paper:
    """The paper of a key or an alias, or of a file that ends in ``.toml``.

    Raises
    ------
    ValueError
        If there is none, or its file is not valid: one sentence with file, key and value.
    """
    return _paper(key_of(name))


def file_of(name: str) -> PaperFile:
    """What the file of a paper says; name and errors as of `paper_of`."""
    return _file(key_of(name))


@cache
def _file(key: str) -> PaperFile:
    path = _path(key)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from None
    return PaperFile.from_toml(table, source=str(path))


def _path(key: str) -> Path:
    return Path(key) if key.endswith(".toml") else FOLDER / f"{key}.toml"


@cache
def _paper(key: str) -> Paper:
    file = _file(key)
    reader = _Reader(file, str(_path(key)))
    settings = (
        s if s.scenario or not s.key else s.model_copy(update={"scenario": file.scenario}) for s in file.settings
    )
    return Paper(
        _path(key).stem, file.authors, file.short, file.title, file.published, file.doi, file.about, file.runs,
        file.full, tuple(Method(n, _list(rows), n in file.smoothed) for n, rows in file.methods.items()),
        tuple(t for k, entry in enumerate(file.tables) for t in reader.tables(entry, f"table[{k}]")),
        tuple(reader.figure(entry, f"figure[{k}]") for k, entry in enumerate(file.figures)),
        file.not_shown, file.notes, tuple(settings), file.variants,
    )  # fmt: skip


def _list(names: Names) -> tuple[str, ...]:
    return ((names,) if names else ()) if isinstance(names, str) else tuple(names)


@dataclass(frozen=True)
class _Reader:
    """What the entries of a file refer to: methods, groups and reasons, by their names."""

    file: PaperFile
    path: str

    def tables(self, entry: TableEntry, where: str) -> Iterator[Table]:
        """The table, or one for each of its parts."""
        for part, scenario in (entry.parts or {"": ""}).items():
            title = entry.title.format(part=part, scenario=scenario) if entry.parts else entry.title
            yield Table(title, tuple(self._rows(entry, scenario, where)), entry.number)

    def figure(self, entry: FigureEntry, where: str) -> Figure:
        """The figure of an entry."""
        series = entry.series
        if not isinstance(series, dict):
            series = {self._known(name, ERROR_LABELS, f"{where}.series"): name for name in series}
        methods = self._methods(entry.methods, f"{where}.methods")
        scenario = entry.scenario or self.file.scenario
        return Figure(entry.number, entry.what, entry.draw, scenario, methods, series, entry.part)

    def _rows(self, table: TableEntry, part: str, where: str) -> Iterator[Row]:
        blocks: Sequence[Rows] = table.rows or (Rows(),)
        above = {n: getattr(table, n) for n in Rows.model_fields if n in table.model_fields_set}
        for scenario in self._names(part or table.scenario) or ("",):
            for k, own in enumerate(blocks):
                given = {n: getattr(own, n) for n in own.model_fields_set}
                block = Rows.model_construct(**{**{n: getattr(Rows(), n) for n in Rows.model_fields}, **above, **given})
                place = f"{where}.rows[{k}]" if table.rows else where
                mine = self._names(own.scenario)
                if scenario:
                    mine = (scenario,) if scenario in (mine or (scenario,)) else ()
                for name in mine if mine or scenario else (self.file.scenario,):
                    yield from self._block(block, name, place)

    def _block(self, block: Rows, scenario: str, where: str) -> Iterator[Row]:
        """The rows of a block on one scenario."""
        scores, than_scores = self._names(block.score), self._names(block.than_score)
        for score in (*scores, *than_scores):
            try:
                measure(score)
            except KeyError:
                raise SpecError(f"{self.path}: {where}.score = {score!r} is no score") from None
        if not scores or not block.method or not scenario:
            raise SpecError(f"{self.path}: {where} should have a scenario, a method and a score")
        if than_scores and len(than_scores) != len(scores):
            raise SpecError(f"{self.path}: {where}.than_score should have one name for each of {len(scores)} scores")
        methods = self._methods(block.method, f"{where}.method")
        if isinstance(block.paper, dict):
            for name in block.paper:
                self._known(name, dict.fromkeys(methods, ""), f"{where}.paper")
        for method in methods:
            figures = self._figures(block.paper, method, len(scores), f"{where}.paper")
            for than in self._methods(block.than, f"{where}.than") or ("",):
                for k, score in enumerate(scores):
                    lower, higher = (
                        self._reason(reasons, score, f"{where}.{name}")
                        for name, reasons in (("lower", block.lower), ("higher", block.higher))
                    )
                    figure = figures[k]
                    if not than:
                        yield Value(scenario, method, score, figure, block.rule, block.derived, lower, higher)
                        continue
                    if isinstance(figure, tuple):
                        raise SpecError(f"{self.path}: {where}.paper: a gain should be one number, not a range")
                    other = than_scores[k] if than_scores else ""
                    yield Gain(scenario, method, than, score, figure, other, block.derived, lower, higher)

    def _figures(self, paper: Cells, method: str, count: int, where: str) -> list[Range | None]:
        """The paper's figures of a method, one for each score."""
        found = paper.get(method, "none") if isinstance(paper, dict) else paper
        texts = found if isinstance(found, list) else [found] * count
        if len(texts) != count:
            raise SpecError(f"{self.path}: {where} = {texts} should have {count} figures, one for each score")
        return [self._figure(text, where) for text in texts]

    def _figure(self, text: Printed, where: str) -> Range | None:
        if not isinstance(text, str):
            return float(text)
        if text == "none":
            return None
        found = _RANGE.fullmatch(text)
        try:
            if found is None:
                raise ValueError
            low, high = float(found[1]), float(found[2])
            if not low < high:
                raise ValueError
        except ValueError:
            raise SpecError(
                f"{self.path}: {where} = {text!r} should be a number, 'none', or a range like '2.7 to 3.4'"
            ) from None
        return low, high

    def _reason(self, reasons: Reasons, score: str, where: str) -> str:
        name = reasons.get(score, "") if isinstance(reasons, dict) else reasons
        return self._known(name, self.file.reasons, where) if name else ""

    def _methods(self, names: Names, where: str) -> tuple[str, ...]:
        """Methods by their names, groups written out."""
        found = self._names(names)
        for name in found:
            self._known(name, dict.fromkeys(self.file.methods, ""), where)
        return found

    def _names(self, names: Names) -> tuple[str, ...]:
        """Names, groups written out."""
        return tuple(n for name in _list(names) for n in self.file.groups.get(name, [name]))

    def _known(self, name: str, known: Mapping[str, str], where: str) -> str:
        """What a name stands for."""
        if name not in known:
            raise SpecError(f"{self.path}: {where} = {name!r} is not known{closest(name, list(known))}")
        return known[name]
