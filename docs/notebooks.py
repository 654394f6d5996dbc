"""The tutorials as notebooks: mkdocs writes one beside each tutorial, from the same page (``hooks`` in ``mkdocs.yml``).

Python blocks and command lines become cells that can be run. A block that the text says to save becomes a cell that
writes the file. All else is text.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

__all__ = ["notebook"]

_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_FILE = re.compile(r"`([\w./-]+\.(?:py|toml))`")
_SAVE = re.compile(r"\bSave this as\b|\bAdd this to the end of\b")


def notebook(markdown: str) -> Any:
    """A notebook (`nbformat.NotebookNode`) of a page.

    Parameters
    ----------
    markdown : str
        The page.
    """
    import jupytext

    before = 0
    parts = []
    for match in _BLOCK.finditer(markdown):
        text = markdown[before : match.start()]
        parts += [text, _cell(match[1], match[2], text)]
        before = match.end()
    parts.append(markdown[before:])
    made = jupytext.reads("".join(parts), "md")
    made.metadata["kernelspec"] = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return made


def _cell(language: str, content: str, text: str) -> str:
    """A block as jupytext takes it: what cannot be run is fenced by tildes, and stays text."""
    paragraph = text.rstrip().rpartition("\n\n")[2]
    saved = _SAVE.search(paragraph)
    if saved and (name := _FILE.search(paragraph, saved.start())):
        more = "-a " if saved[0].startswith("Add") else ""
        return f"```python\n%%writefile {more}{name[1]}\n{content}```"
    if language == "python":
        return f"```python\n{content}```"
    if not language and content.startswith("simnav "):
        lines = "".join(f"!{line}\n" if line.startswith("simnav ") else f"{line}\n" for line in content.splitlines())
        return f"```python\n{lines}```"
    return f"~~~{language}\n{content}~~~"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a notebook beside each tutorial."""
    import nbformat

    for path in tutorials(Path(config.docs_dir)):
        made = notebook(path.read_text(encoding="utf-8"))
        where = f"tutorials/{path.stem}.ipynb"
        files.append(File.generated(config, where, content=nbformat.writes(made)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Name the notebook below the title of a tutorial."""
    path = Path(page.file.src_uri)
    if path.parts[:1] != ("tutorials",) or path.stem == "index":
        return markdown
    title, _, rest = markdown.partition("\n")
    return f"{title}\n\n[This page as a notebook]({path.stem}.ipynb){{download}}\n{rest}"


def tutorials(docs: Path) -> list[Path]:
    """The pages that become notebooks."""
    return sorted(p for p in (docs / "tutorials").glob("*.md") if p.stem != "index")
