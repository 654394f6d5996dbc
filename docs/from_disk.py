"""Search in the documentation where it is opened from disk (``hooks`` in ``mkdocs.yml``).

The theme searches in a worker, and a page from disk may start none from a file. So the build writes two scripts beside
the index of the search: ``search/search_index.js``, which the theme reads from disk, and ``search/from_disk.js``, which
holds the worker as a text and starts it from there. Nothing is taken from the net.
"""

from __future__ import annotations

import json
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError

SCRIPT = "search/from_disk.js"

_START = """if (location.protocol === "file:") {{
  const Native = window.Worker, source = {source};
  window.Worker = class extends Native {{
    constructor(address) {{
      const ours = String(address).includes("/assets/javascripts/workers/search.");
      super(ours ? URL.createObjectURL(new Blob([source], {{ type: "text/javascript" }})) : address);
    }}
  }};
}}
"""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Let the theme load the script before its own."""
    config.extra.setdefault("polyfills", []).append(SCRIPT)
    return config


def on_post_build(config: MkDocsConfig) -> None:
    """Write the two scripts."""
    site = Path(config.site_dir)
    workers = sorted((site / "assets" / "javascripts" / "workers").glob("search.*.js"))
    index = site / "search" / "search_index.json"
    if len(workers) != 1 or not index.is_file():
        raise PluginError(f"{site} has {len(workers)} scripts of the search, and one is wanted, with {index.name}")
    source = workers[0].read_text(encoding="utf-8").partition("//# sourceMappingURL")[0]
    index.with_suffix(".js").write_text(f"var __index = {index.read_text(encoding='utf-8')};\n", encoding="utf-8")
    (site / SCRIPT).write_text(_START.format(source=json.dumps(source)), encoding="utf-8")
