"""The registry: names, files, plug-ins, parameters."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys
import textwrap
import warnings
from pathlib import Path
from typing import Any, Literal

import pytest

from simnav.estimator import Estimator, EstimatorError, describe, find, make, names, register, registry
from simnav.types import Estimate

BODY = """
    def reset(self, start, instruments):
        self.start = start
    def update(self, measurements):
        return Estimate(measurements.time)
"""
HEAD = "from simnav import Estimate, Estimator, register\n"


pytestmark = pytest.mark.usefixtures("clean_registry")


def write(path: Path, text: str) -> str:
    path.write_text(HEAD + textwrap.dedent(text))
    return str(path)


class Plain(Estimator):
    """First line.

    More.
    """

    def __init__(
        self,
        gate: float = 3.0,
        window: int = 10,
        smooth: bool = False,
        mode: Literal["fast", "exact"] = "fast",
        limits: tuple[float, ...] = (1.0, 2.0),
        path: str | None = None,
        anything=None,
    ):
        self.values = (gate, window, smooth, mode, limits, path, anything)
        if gate < 0:
            raise ValueError(f"gate = {gate:g} should not be negative")

    def reset(self, start, instruments):
        pass

    def update(self, measurements):
        return Estimate(measurements.time)


def test_the_reference_estimators_are_found_without_compiling_or_heavy_imports():
    code = (
        "import sys; from simnav.estimator import names, describe; found = names(); [describe(n) for n in found];"
        "heavy = [m for m in ('numba', 'gtsam', 'filterpy', 'scipy', 'matplotlib', 'pyarrow') if m in sys.modules];"
        "assert not heavy, heavy; assert {'ekf', 'ship-ekf', 'inertial', 'dead-reckoning', 'gnss-only', 'oracle'}"
        " <= set(found), found"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_register_and_make():
    register("plain", aliases=("simple",))(Plain)
    assert find("plain") is find("simple") is Plain
    assert Plain.name == "plain"
    assert "plain" in names()
    assert "simple" not in names()
    about = describe("simple")
    assert (about.name, about.aliases, about.summary, about.reference) == ("plain", ("simple",), "First line.", False)
    assert about.file == __file__
    assert Path(__file__).read_text().splitlines()[about.line - 1] == "class Plain(Estimator):"
    assert [p.name for p in about.parameters] == ["gate", "window", "smooth", "mode", "limits", "path", "anything"]
    assert about.parameters[0].default == 3.0
    assert not about.parameters[0].required


@pytest.mark.parametrize(
    ("given", "index", "expected"),
    [
        ({"gate": "1e-3"}, 0, 1e-3),
        ({"gate": 4}, 0, 4),
        ({"window": "20"}, 1, 20),
        ({"smooth": "true"}, 2, True),
        ({"smooth": "off"}, 2, False),
        ({"mode": "exact"}, 3, "exact"),
        ({"limits": "0.5, 7"}, 4, (0.5, 7.0)),
        ({"path": "none"}, 5, None),
        ({"path": "a,b"}, 5, "a,b"),
        ({"anything": "3"}, 6, 3),
        ({"anything": "x"}, 6, "x"),
    ],
)
def test_parameters_are_converted(given: dict[str, Any], index: int, expected: Any):
    register("plain")(Plain)
    value = make("plain", **given).values[index]
    assert value == expected
    assert type(value) is type(expected)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gat": "1"}, "no parameter 'gat'; did you mean 'gate'?"),
        ({"gate": "wide"}, "parameter 'gate' of estimator 'plain' is a number, not 'wide'"),
        ({"window": "2.5"}, "is a whole number, not '2.5'"),
        ({"window": 2.5}, "is a whole number, not 2.5"),
        ({"smooth": "maybe"}, "is true or false, not 'maybe'"),
        ({"mode": "slow"}, "is one of fast, exact, not 'slow'"),
        ({"gate": "-1"}, "gate = -1 should not be negative"),
    ],
)
def test_bad_parameters_are_a_sentence(given: dict[str, Any], message: str):
    register("plain")(Plain)
    with pytest.raises(EstimatorError) as caught:
        make("plain", **given)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


class Wide(Plain):
    """Takes what its bases take by name."""

    def __init__(self, *, width: float = 1.0, gate: float = 5.0, **options: Any):
        super().__init__(gate, **options)
        self.width = width


class Wider(Wide):
    """One more."""

    def __init__(self, depth: int = 2, **options: Any):
        super().__init__(**options)
        self.depth = depth


class Open(Estimator):
    """Takes anything."""

    def __init__(self, **options: Any):
        self.options = options

    def reset(self, start, instruments):
        pass

    def update(self, measurements):
        return Estimate(measurements.time)


def test_a_constructor_with_stars_has_the_parameters_that_its_bases_take_by_name_only():
    register("wider")(Wider)
    assert [(p.name, p.default) for p in describe("wider").parameters] == [("depth", 2), ("width", 1.0), ("gate", 5.0)]
    made = make("wider", depth="3", width="2", gate="4")
    assert (made.depth, made.width, made.values[0]) == (3, 2.0, 4.0)
    assert type(made.width) is float
    with pytest.raises(EstimatorError, match="no parameter 'widht'; did you mean 'width'"):
        make("wider", widht="2")
    with pytest.raises(EstimatorError, match="no parameter 'window'"):  # Plain's, but not by name only
        make("wider", window="2")


def test_a_constructor_that_takes_anything_is_given_it():
    register("open")(Open)
    assert describe("open").parameters == ()
    assert make("open", depth="3").options == {"depth": 3}


def test_an_estimator_without_parameters_says_so():
    with pytest.raises(EstimatorError, match=r"has no parameter 'gate'; it takes none"):
        make("inertial", gate="3")


def test_unknown_names_suggest_the_nearest():
    with pytest.raises(EstimatorError, match=r"unknown estimator 'ship-ekv'; did you mean 'ship-ekf'"):
        find("ship-ekv")


@pytest.mark.parametrize(
    ("name", "file"),
    [("alpha-beta", "alpha_beta.py"), ("alpha_beta", "alpha_beta.py"), ("first", "two.py:A"), ("odd", "odd.py")],
)
def test_an_unknown_name_of_a_file_that_is_here_hints_at_it(
    name: str, file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Nothing is imported for it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.py").write_text('def f(:  # "alpha-beta", "first"')
    (tmp_path / "alpha_beta.py").write_text('raise SystemExit\n@register("alpha-beta")\nclass A: ...\n')
    (tmp_path / "two.py").write_text('@register("first")\nclass A: ...\n@register("second")\nclass B: ...\n')
    (tmp_path / "odd.py").write_text("")
    with pytest.raises(EstimatorError, match=rf"unknown estimator '{name}'; give its file: {file}$"):
        find(name)


def test_a_scenario_is_no_estimator():
    with pytest.raises(EstimatorError, match=r"'channel.toml' is a scenario and no estimator"):
        find("channel.toml")


def test_a_class_has_a_version_of_its_own():
    class Second(Plain):
        version = 2

    class Third(Second):
        pass

    assert (Plain.version, Second.version, Third.version) == (1, 2, 1)
    for wrong in (0, "1"):
        Third.version = wrong
        with pytest.raises(EstimatorError, match=f"version = {wrong!r} should be a whole number from 1"):
            register("third")(Third)


def test_collisions_are_refused_and_placed():
    register("plain", aliases=("simple",))(Plain)
    other = type("Other", (Plain,), {})
    for taken in ("plain", "simple"):
        with pytest.raises(EstimatorError, match=rf"'{taken}'.*taken by Plain \(.*test_estimator.py, line \d+\)"):
            register(taken)(other)
    with pytest.raises(EstimatorError, match=r"'plain'.*taken by Plain"):
        register("other", aliases=("plain",))(other)
    assert "other" not in names()
    register("plain")(Plain)  # the same class again, as in a notebook


@pytest.mark.parametrize("bad", ["My_Filter", "myFilter", "-x", "a b", ""])
def test_names_are_kebab_case(bad: str):
    with pytest.raises(EstimatorError, match=r"not kebab-case"):
        register(bad)


def test_only_estimators_register():
    with pytest.raises(EstimatorError, match=r"int is not a subclass of simnav.Estimator"):
        register("number")(int)  # type: ignore[type-var]


def test_a_file_with_one_class(tmp_path: Path):
    path = write(tmp_path / "mine.py", 'class MyUKFilter(Estimator):\n    """Mine."""\n' + BODY)
    cls = find(path)
    assert cls.name == "my-uk-filter"
    assert find(path) is cls
    assert find(path + ":MyUKFilter") is cls
    assert describe(path).summary == "Mine."
    assert describe(path).file == path
    assert isinstance(make(path), cls)


def test_a_decorated_class_keeps_its_name_and_may_import_its_neighbour(tmp_path: Path):
    (tmp_path / "neighbour_of_mine.py").write_text("gain = 0.5\n")
    text = 'from neighbour_of_mine import gain\n@register("given")\nclass A(Estimator):\n' + BODY
    assert find(write(tmp_path / "mine.py", text)).name == "given"
    assert find("given").__name__ == "A"


def test_an_edited_file_replaces_its_older_self(tmp_path: Path):
    path = tmp_path / "mine.py"
    first = find(write(path, '@register("given")\nclass A(Estimator):\n' + BODY))
    second = find(write(path, '@register("given")\nclass A(Estimator):\n    """New."""\n' + BODY))
    assert first is not second
    assert find("given") is second


def test_a_file_with_several_classes_asks(tmp_path: Path):
    path = write(tmp_path / "two.py", "class A(Estimator):" + BODY + "\nclass B(Estimator):" + BODY)
    with pytest.raises(EstimatorError, match=r"several estimators; ask for one of them: two.py:A, two.py:B"):
        find(path)
    assert find(path + ":B").__name__ == "B"
    with pytest.raises(EstimatorError, match=r"no estimator class 'C'; there are: two.py:A, two.py:B"):
        find(path + ":C")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n", "holds no class that is a complete subclass"),
        ("import nonsense_that_is_not\n", "bad.py, line 2: it cannot be imported: ModuleNotFoundError: No module"),
        ("def f(:\n", "bad.py, line 2: it cannot be imported: SyntaxError"),
        ("\n1 / 0\n", "bad.py, line 3: it cannot be imported: ZeroDivisionError"),
        ("raise SystemExit(3)\n", "bad.py, line 2: it cannot be imported: SystemExit"),
        ("class A(Estimator):\n    def reset(self, start, instruments): ...\n", "A lacks update"),
        ('@register("ekf")\nclass A(Estimator):\n' + BODY, "the name is taken by Ekf"),
        ("class Ekf(Estimator):\n" + BODY, "the name is taken by Ekf"),
    ],
)
def test_bad_files_are_a_sentence(tmp_path: Path, text: str, message: str):
    path = write(tmp_path / "bad.py", text)
    with pytest.raises(EstimatorError) as caught:
        find(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert find("ekf").__module__ == "simnav.estimators.rows.kalman"


def test_absent_files():
    with pytest.raises(EstimatorError, match=r"no estimator file 'nowhere.py'"):
        find("nowhere.py")


class _Point:
    """A stand-in for an entry point."""

    dist = None

    def __init__(self, name: str, load: Any):
        self.name, self.value, self.load = name, f"{name}_package", load


def test_a_broken_plug_in_is_named_and_harms_nobody(monkeypatch: pytest.MonkeyPatch):
    def broken() -> None:
        register("half-done")(type("HalfDone", (Plain,), {}))
        raise RuntimeError("no licence")

    def thief() -> None:
        register("ekf")(type("Thief", (Plain,), {}))

    good = type("Good", (Plain,), {"__module__": "good_package"})
    real = list(importlib.metadata.entry_points(group=registry.GROUP))
    points = [_Point("a-broken", broken), _Point("a-thief", thief), _Point("good-one", lambda: good), *real]
    monkeypatch.setattr(registry, "entry_points", lambda group: points)
    registry.discover_point("")  # no package's, until an unknown name is asked for
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert find("good-one") is good
        found = names()
    said = [str(w.message) for w in caught]
    assert any("'a-broken'" in s and "RuntimeError: no licence" in s for s in said)
    assert any("'a-thief'" in s and "taken by Ekf" in s for s in said)
    assert "half-done" not in found
    assert {"ekf", "good-one"} <= set(found)
    assert find("ekf").__module__ == "simnav.estimators.rows.kalman"
