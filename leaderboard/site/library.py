"""The chart library of the site: one copy of Vega, Vega-Lite and Vega-Embed, as the package vl-convert holds them."""

from __future__ import annotations

import contextlib
from importlib.metadata import version

from simnav.leaderboard.results.user_cache import keep, user_cache

__all__ = ["VEGA_LITE", "bundle"]

#: Version of Vega-Lite that the specifications are written for.
VEGA_LITE = "6.4"

_SETS = "window.vega = vega; window.vegaLite = vegaLite; window.vegaEmbed = vegaEmbed;"

_LICENCE = """\
/*! Vega, Vega-Lite and Vega-Embed. Copyright (c) 2015-2026, University of Washington Interactive Data Lab and
contributors. Redistribution and use in source and binary forms, with or without modification, are permitted provided
that the following conditions are met: 1. Redistributions of source code must retain the above copyright notice, this
list of conditions and the following disclaimer. 2. Redistributions in binary form must reproduce the above copyright
notice, this list of conditions and the following disclaimer in the documentation and/or other materials provided with
the distribution. 3. Neither the name of the copyright holder nor the names of its contributors may be used to endorse
or promote products derived from this software without specific prior written permission. THIS SOFTWARE IS PROVIDED BY
THE COPYRIGHT HOLDERS AND CONTRIBUTORS "AS IS" AND ANY EXPRESS OR IMPLIED WARRANTIES, INCLUDING, BUT NOT LIMITED TO, THE
IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR PURPOSE ARE DISCLAIMED. IN NO EVENT SHALL THE
COPYRIGHT HOLDER OR CONTRIBUTORS BE LIABLE FOR ANY DIRECT, INDIRECT, INCIDENTAL, SPECIAL, EXEMPLARY, OR CONSEQUENTIAL
DAMAGES (INCLUDING, BUT NOT LIMITED TO, PROCUREMENT OF SUBSTITUTE GOODS OR SERVICES; LOSS OF USE, DATA, OR PROFITS; OR
BUSINESS INTERRUPTION) HOWEVER CAUSED AND ON ANY THEORY OF LIABILITY, WHETHER IN CONTRACT, STRICT LIABILITY, OR TORT
(INCLUDING NEGLIGENCE OR OTHERWISE) ARISING IN ANY WAY OUT OF THE USE OF THIS SOFTWARE, EVEN IF ADVISED OF THE
POSSIBILITY OF SUCH DAMAGE. */
"""


def bundle() -> str:
    """The libraries as one script, which sets ``vega``, ``vegaLite`` and ``vegaEmbed``; about 900 kB.

    Putting it together takes seconds, so it is kept in the user's cache, once for each version.
    """
    kept = user_cache() / f"vega-{version('vl-convert-python')}-{VEGA_LITE}.js"
    with contextlib.suppress(OSError):
        return kept.read_text(encoding="utf-8")
    import vl_convert

    made = _LICENCE + vl_convert.javascript_bundle(_SETS, vl_version=VEGA_LITE)
    keep(kept, made)
    return made
