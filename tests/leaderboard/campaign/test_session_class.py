"""Estimators of a session: sent to workers, known by their source text."""

from __future__ import annotations

import linecache
import subprocess
import sys
import textwrap
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from simnav.leaderboard.campaign.fingerprint import estimator_source
from simnav.leaderboard.campaign.session_class import is_session, pickle_class, receive, source_of
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from tests.cases import POND

# A notebook: its cells are compiled one by one in __main__, with their lines where inspect finds them.
NOTEBOOK = '''
import linecache, sys, __main__

def cell(number, text):
    name = f"<cell {number}>"
    linecache.cache[name] = (len(text), None, text.splitlines(True), name)
    exec(compile(text, name, "exec"), vars(__main__))

for first, gain in enumerate(@GAINS@):  # the cells once more, with another value
    cell(f"{first}, 1", f"""
import numpy as np
import simnav
GAIN = {gain}

def blend(old, new):
    return old + GAIN * (new - old)
""")
    cell(f"{first}, 2", """
class LastFix(simnav.Estimator):
    'Keeps the last fix.'
    def reset(self, start, instruments):
        self.position = np.array(start.position)
    def update(self, measurements):
        for m in measurements:
            self.position = blend(self.position, m.value)
        return simnav.Estimate(measurements.time, self.position.copy())
""")
    cell(f"{first}, 3", """
report = simnav.campaign("pond.toml", [LastFix, "gnss-only"], runs=2, output="out", workers=@WORKERS@, oracle=False)
print(report.summary.computed, *sorted({(r.estimator, r.status) for r in report.results}))
""")
'''


def notebook(folder: Path, *gains: float, workers: int = 1) -> list[str]:
    text = NOTEBOOK.replace("@GAINS@", repr(gains)).replace("@WORKERS@", str(workers))
    (folder / "pond.toml").write_text(POND)
    # From standard input: there is no file that a worker could import.
    done = subprocess.run([sys.executable, "-"], input=text, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_class_of_a_notebook_takes_part_and_is_known_by_its_text(tmp_path: Path) -> None:
    good = "('gnss-only', 'ok') ('last-fix', 'ok')"
    assert notebook(tmp_path, 1.0, workers=2) == [f"4 {good}"]
    # Another session with the same text, then with another value that a function of the session uses.
    assert notebook(tmp_path, 1.0, 0.5) == [f"0 {good}", f"2 {good}"]
    rmse = {r.estimator: r.scores["horizontal_rmse"] for r in store.load(tmp_path / "out")}
    assert 0.1 < rmse["last-fix"] < 10.0


def module(name: str, text: str) -> Any:
    """A module that was never a file, as of a session."""
    made = ModuleType(name)
    sys.modules[name] = made
    source = textwrap.dedent(text)
    linecache.cache[f"<{name}>"] = (len(source), None, source.splitlines(True), f"<{name}>")
    exec(compile(source, f"<{name}>", "exec"), vars(made))
    return made


@pytest.fixture
def session(request: pytest.FixtureRequest) -> Any:
    def make(text: str) -> Any:
        made = module("a_session", text)
        request.addfinalizer(lambda: sys.modules.pop("a_session", None))
        return made

    return make


def test_what_no_other_process_can_import() -> None:
    assert is_session("__main__")
    assert not is_session("simnav.estimators.rows.kalman")
    assert not is_session("json.decoder")
    assert is_session("no_such_module")


BASE = """
FACTOR = 2

def double(x):
    return FACTOR * x

class Mine:
    @property
    def two(self):
        return double(1)

    def other(self):
        return 3
"""


def test_a_class_is_carried_with_what_it_uses(session: Any) -> None:
    data = pickle_class(session(BASE).Mine)
    del sys.modules["a_session"]
    assert receive(data)().two == 2


@pytest.mark.parametrize(
    ("change", "differs"),
    [
        (("return 3", "return 4"), True),
        (("FACTOR = 2", "FACTOR = 3"), True),
        (("return FACTOR * x", "return x * FACTOR"), True),
        (("FACTOR = 2", "FACTOR = 2\nUNUSED = 5"), False),
        (("class Mine:", "\n\n\nclass Mine:"), False),
        (("class Mine:", "class Mine:  # a comment"), False),
        (("class Mine:", 'class Mine:\n    """A docstring."""'), False),
        (("class Mine:", "class Mine:\n    gain = 1"), True),
    ],
)
def test_the_text_holds_the_class_and_what_it_uses(session: Any, change: tuple[str, str], differs: bool) -> None:
    before, modules = source_of(session(BASE).Mine)
    assert modules == []
    assert "name='Mine'" in before
    assert "name='double'" in before
    after, _ = source_of(session(BASE.replace(*change)).Mine)
    assert (before != after) is differs


@pytest.mark.parametrize(
    "line",
    [
        "    gain = FACTOR",
        "    gains = np.array([FACTOR])",
        "    gains = [FACTOR]",
        "    part = Part",
        "    parts = (Part(),)",
        "    def first(self, gain=FACTOR): pass",
        "    def second(self, *, gain=FACTOR): pass",
    ],
)
@pytest.mark.parametrize("with_text", [True, False])
def test_what_a_class_computed_when_it_was_defined_counts(session: Any, line: str, with_text: bool) -> None:
    """A constant that changes in another cell of the notebook, with the cell of the class as it was."""
    text = "import numpy as np\nFACTOR = 2\n\nclass Part:\n    factor = FACTOR\n\nclass Mine:\n" + line + "\n"
    found = []
    for constant in ("FACTOR = 2", "FACTOR = 2", "FACTOR = 3"):
        made = session(text.replace("FACTOR = 2", constant))
        if not with_text:
            linecache.cache.pop("<a_session>")
        found.append(source_of(made.Mine)[0])
    assert found[0] == found[1] != found[2]


def test_without_a_text_the_compiled_code_stands_for_it(session: Any) -> None:
    def compiled(text: str) -> str:
        made = session(text)
        linecache.cache.pop("<a_session>")
        return source_of(made.Mine)[0]

    assert compiled(BASE) == compiled(BASE)
    assert compiled(BASE) != compiled(BASE.replace("return 3", "return 4"))
    assert compiled(BASE) != compiled(BASE.replace("return FACTOR * x", "return FACTOR + x"))


def test_the_class_of_a_value_that_it_uses_counts(session: Any) -> None:
    gain = "class Gain:\n    def value(self):\n        return 1\n\nGAIN = Gain()\n"
    assert "ClassDef(name='Gain'" in source_of(session(gain + BASE.replace("FACTOR *", "GAIN.value() *")).Mine)[0]


def test_files_beside_a_notebook_count_but_not_what_is_installed(
    session: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    helper = tmp_path / "beside_a_notebook.py"
    helper.write_text("GAIN = 1\n")
    text = "import json\nimport numpy as np\nimport beside_a_notebook as b\n"
    text += "from simnav.geometry.earth import displace\n"
    text += "class Mine:\n    def f(self):\n        return np.ones(b.GAIN), json.dumps(1), displace\n"
    made = session(text)
    assert source_of(made.Mine)[1] == ["beside_a_notebook", "json", "numpy", "simnav.geometry.earth"]
    before = estimator_source(made.Mine)
    (tmp_path / "unrelated.py").write_text("1\n")
    assert estimator_source(made.Mine) == before
    helper.write_text("GAIN = 2\n")
    assert estimator_source(made.Mine) != before
    del sys.modules["beside_a_notebook"]


def test_the_file_of_the_class_of_a_value_counts(session: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A session uses an object, and not the name of its class, which is in a file of the user's own."""
    monkeypatch.syspath_prepend(tmp_path)
    helper = tmp_path / "gain_of_a_notebook.py"
    helper.write_text("class Gain:\n    value = 1\n")
    made = session(
        "import gain_of_a_notebook as g\nGAINS = [g.Gain()]\n" + BASE.replace("FACTOR *", "GAINS[0].value *")
    )
    before = estimator_source(made.Mine)
    helper.write_text("class Gain:\n    value = 2\n")
    assert estimator_source(made.Mine) != before
    del sys.modules["gain_of_a_notebook"]


def test_what_cannot_be_sent_is_told(session: Any) -> None:
    made = session(BASE.replace("FACTOR = 2", "import threading\nFACTOR = threading.Lock()"))
    with pytest.raises(RequestError, match=r"Mine cannot be sent to a worker .* put it into a file"):
        pickle_class(made.Mine)


def test_a_class_of_a_module_beside_the_script_takes_part(tmp_path: Path):
    """Its folder is on the path as an empty entry, and the estimator runs in another folder."""
    text = NOTEBOOK.replace("{gain}", "1.0").replace("@WORKERS@", "1")
    parts = [part.strip() for part in text.split('"""')[1::2]]
    (tmp_path / "beside.py").write_text(f"{parts[0]}\n{parts[1]}\n")
    (tmp_path / "pond.toml").write_text(POND)
    script = "import simnav\nfrom beside import LastFix\n" + parts[2]
    done = subprocess.run([sys.executable, "-"], input=script, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "('last-fix', 'ok')" in done.stdout
