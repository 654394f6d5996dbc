"""Pages of the documentation that are made from the code: commands, estimators, scores, instruments and faults.

mkdocs calls `on_files` (``hooks`` in ``mkdocs.yml``).
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

NOTE = "*This page is generated from the code.*"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Put the generated pages in the place of those that stand for them in a checkout."""
    pages = {
        "reference/commands.md": commands(),
        "reference/rows.md": rows(),
        "reference/scores.md": scores(),
        "reference/instruments.md": instruments(),
    }
    for path, made in (("reference/python.md", calls), ("reference/scenarios.md", tracks)):
        (page,) = (file for file in files if file.src_uri == path)
        pages[path] = f"{page.content_string}\n{made()}"
    for path, text in pages.items():
        if (stands := files.get_file_from_path(path)) is not None:
            files.remove(stands)
        files.append(File.generated(config, path, content=text))
    return files


def calls() -> str:
    """All calls of ``import simnav`` with their options, which come from their requests."""
    from simnav.leaderboard import costing, datasets, inspection, publishing, recommending, running

    parts = []
    for module in (running, recommending, datasets, inspection, costing, publishing):
        for name in (n for n in module.__all__ if inspect.isfunction(getattr(module, n))):
            call = getattr(module, name)
            doc, taken = inspect.getdoc(call) or "", inspect.signature(call).parameters
            text, meanings = _sections(doc)
            shown = [f"{p}" if p.kind is p.VAR_KEYWORD else p.name for p in taken.values()]
            parts += [f"## simnav.{name}", f"`simnav.{name}({', '.join(shown)})`", _escaped(text)]
            lines = (
                _line((
                    f"`{p.name}`", "required" if p.default is p.empty else f"`{p.default!r}`",
                    _escaped(meanings.get(p.name, "")),
                ))
                for p in taken.values()
                if p.name in meanings
            )  # fmt: skip
            parts.append("\n".join((*_head("argument", "default", "meaning"), *lines)))
            ends = re.findall(r"\n\n(Returns|Raises)\n-+\n(.*?)(?=\n\n\w[\w ]*\n-{4,}\n|\Z)", doc, re.DOTALL)
            parts += [f"{section}: {_escaped(re.sub(chr(10) + '    ', ': ', body).replace(chr(10), ' '))}"
                      for section, body in ends]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def tracks() -> str:
    """The tracks of the catalogue: name, title, instruments and scenarios, and whether the standard result has them."""
    from simnav.leaderboard.profiles import read_profile
    from simnav.leaderboard.ranking.similar_scenarios import carried
    from simnav.leaderboard.ranking.tracks import catalogued, tracks_of

    found = catalogued()
    ranked = {name for part in read_profile("standard").parts for name in part.scenarios}
    lines = []
    for track in tracks_of(found, {name: header.track for name, header in found.items()}):
        carry = [carried(found[name]) for name in track.scenarios]
        always = frozenset.intersection(*(c.always for c in carry))
        some = frozenset.union(*(c.always | c.sometimes for c in carry)) - always
        kinds = "; ".join(filter(None, [_kinds(always), f"some: {_kinds(some)}" if some else ""]))
        board = any(found[name].name in ranked or name in ranked for name in track.scenarios)
        cells = (f"`{track.name}`", track.title, kinds, str(len(track.scenarios)), "yes" if board else "no")
        lines.append(_line(cells))
    text = "In commands a track is called by its name (`simnav campaign -s aided-ins`), and on the board by its title. "
    text += "`post-processing` has the scenarios of `aided-ins` and `underwater`."
    head = _head("name", "title", "instruments", "scenarios", "in the standard result")
    return "\n\n".join(("## Tracks", NOTE.replace("page", "table"), text, "\n".join((*head, *lines)))) + "\n"


def _kinds(kinds: Iterable[str]) -> str:
    return ", ".join(f"`{kind}`" for kind in sorted(kinds))


def commands() -> str:
    """All commands with their arguments and options."""
    import typer.main

    from simnav.leaderboard.cli import app

    root = typer.main.get_command(app)
    parts = [
        "# Command line",
        NOTE,
        "Results go to standard output, messages to standard error. The exit code is 0 for success, 1 for a failure "
        "and 2 for a mistake of the user (3: see campaign verify). `--json` prints a document for other programs.",
    ]
    for name, command in _commands(root, "simnav"):
        help_text = re.sub(r"\s+", " ", command.help or "").strip()
        parts += [f"## {name}", help_text]
        lines = [
            _line((f"`{_invocation(p)}`", _escaped(p.help or ""), _default(p)))
            for p in command.params
            if p.name != "help" and not getattr(p, "hidden", False)
        ]
        if lines:
            parts.append("\n".join((*_head("argument or option", "meaning", "default"), *lines)))
    return "\n\n".join(parts) + "\n"


def _commands(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    children = getattr(command, "commands", {})
    for key, child in sorted(children.items()):
        group = bool(getattr(child, "commands", None))
        if not group or child.invoke_without_command:
            yield f"{name} {key}", child
        if group:
            yield from _commands(child, f"{name} {key}")


def _invocation(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return str(parameter.metavar or parameter.name.upper())
    return ", ".join((*parameter.opts, *parameter.secondary_opts))


def _default(parameter: Any) -> str:
    value = parameter.default
    if parameter.required:
        return "required"
    return "" if value is None or value is False or callable(value) or value == [] else f"`{value}`"


def rows() -> str:
    """All estimators with their docstrings and parameters."""
    from simnav.estimator import describe, find, names

    parts = [
        "# Estimators in detail",
        NOTE,
        "The descriptions of the parameters come from the pieces that an estimator is made of. "
        "[Estimators](estimators.md) has an overview.",
    ]
    for name in names():
        about = describe(name)
        text, parameters = _sections(inspect.getdoc(find(name)) or "")
        aliases = f" Also: {', '.join(f'`{a}`' for a in about.aliases)}." if about.aliases else ""
        kind = " A reference, which is not ranked." if about.reference else ""
        parts += [f"## {name}", _escaped(text) + aliases + kind]
        if about.parameters:
            lines = (
                _line((f"`{p.name}`", f"`{p.default}`", _escaped(parameters.get(p.name, "")))) for p in about.parameters
            )
            parts.append("\n".join((*_head("parameter", "default", "meaning"), *lines)))
    return "\n\n".join(parts) + "\n"


def _sections(docstring: str) -> tuple[str, dict[str, str]]:
    """The text before the parameters of a numpydoc docstring, and the meaning of each parameter."""
    text, _, rest = docstring.partition("\nParameters\n----------\n")
    text = re.split(r"\n\w[\w ]*\n-{4,}\n", text)[0]
    meanings: dict[str, str] = {}
    body = re.split(r"\n\n\w[\w ]*\n-{4,}\n", rest)[0]
    for match in re.finditer(
        r"^(\S[^\n]*?) ?: ?([^\n]*)\n((?:[ \t]+[^\n]*\n?|\n(?=[ \t]))*)", body + "\n", re.MULTILINE
    ):
        for name in match[1].split(","):
            meanings[name.strip()] = re.sub(r"\s+", " ", match[3]).strip()
    return text.strip(), meanings


def scores() -> str:
    """All scores with title, unit and direction."""
    from simnav.scoring import SCORES

    better = {"lower": "lower is better", "higher": "higher is better", "one": "one is best", None: ""}
    lines = [_line((f"`{name}`", s.title, s.unit, better.get(s.better, str(s.better)))) for name, s in SCORES.items()]
    head = _head("name", "title", "unit", "direction")
    text = "Scores are computed for each run. A score that does not apply to a run is left out. "
    text += "[Add a score](../how-to/add-a-score.md) shows how to register one, and the [glossary](../glossary.md) "
    text += "explains the terms."
    return "\n\n".join(("# Scores", NOTE, text, "\n".join((*head, *lines)))) + "\n"


def instruments() -> str:
    """All kinds of instruments and faults with what they measure and do."""
    from simnav.kinds import KINDS
    from simnav.sensors import fault_specs
    from simnav.sensors.imu_models import ASSUMED

    lines = []
    for name, kind in sorted(KINDS.items()):
        components = ", ".join(f"{c.name} [{c.unit.replace('_', '/')}]" for c in kind.components)
        lines.append(_line((f"`{name}`", kind.quantity, components, kind.role)))
    parts = [
        "# Instruments and faults",
        NOTE,
        "The keys of each kind in a scenario file are in [Scenarios](scenarios.md).",
        "## Kinds of instruments",
        "Beside these there is the IMU (`imu`).",
        "\n".join((*_head("kind", "quantity", "components", "role"), *lines)),
        "## IMUs by name",
        "With `model` or `grade` in `[instruments.imu]` the figures are those of a datasheet; `simnav list imus` "
        "says where each was read. A figure in *italics* is assumed: the datasheet does not state it, and the "
        "datasheet that estimators receive names it in `assumed`. The model in **bold** is meant by its grade.",
        _imus(),
        "What is assumed of a grade, and why:",
        "\n".join(f"- {grade}: {_escaped(assumed.source)}." for grade, assumed in ASSUMED.items()),
        "The models drift without aids in the order of their grades, and within published classes: "
        "`python -m tests.audit grades` measures it. An hour without aids tells nothing of MEMS and industrial grade, "
        "because the attitude is lost before.",
        "## Kinds of faults",
        "\n".join(
            (
                *_head("kind", "effect"),
                *sorted(_line((f"`{_kind(s)}`", _escaped(_summary(s)))) for s in fault_specs()),
            )
        ),
    ]
    return "\n\n".join(parts) + "\n"


def _imus() -> str:
    """A table of the IMUs by name."""
    from simnav.sensors.imu_models import GRADES, IMU_MODELS

    def figures(stated: Mapping[str, float], assumed: Mapping[str, float]) -> str:
        cells = [f"`{key}` {value:.6g}" for key, value in stated.items()]
        return ", ".join([*cells, *(f"*`{key}` {value:.6g}*" for key, value in assumed.items())])

    rows = [
        (
            f"**{m.name}**" if GRADES[m.grade] == m.name else m.name, m.grade,
            figures(m.gyroscope, m.assumed["gyroscope"]), figures(m.accelerometer, m.assumed["accelerometer"]),
        )
        for m in IMU_MODELS.values()
    ]  # fmt: skip
    return "\n".join((*_head("model", "grade", "gyroscope", "accelerometer"), *map(_line, rows)))


def _kind(spec: Any) -> str:
    return str(spec.model_fields["kind"].default)


def _summary(cls: type) -> str:
    return (inspect.getdoc(cls) or "").partition("\n\n")[0].replace("\n", " ")


def _head(*titles: str) -> tuple[str, str]:
    return _line(titles), _line(["---"] * len(titles))


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _escaped(text: str) -> str:
    """Text of a docstring as Markdown: code marks, and no characters that a table or HTML would take."""
    text = text.replace("``", "`").replace("|", "\\|").replace("<", "&lt;")
    return re.sub(r"`(simnav\.[\w.]+)`", r"`\1`", text)
