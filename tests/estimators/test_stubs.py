"""Stub files of rows: they are current, and type checkers, editors and documentation read them."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pytest

from simnav.estimator import find, names
from simnav.estimators.composition import Row
from simnav.estimators.stubs import main, own_modules, stub_of

ROOT = Path(__file__).parents[2]


def test_the_stubs_of_our_rows_are_current():
    for module in own_modules():
        path = Path(inspect.getfile(module)).with_suffix(".pyi")
        assert path.is_file(), f"python -m simnav.estimators.stubs writes {path.name}"
        assert path.read_text(encoding="utf-8") == stub_of(module), (
            f"{path.name}: run python -m simnav.estimators.stubs"
        )
    assert {find(n).__module__ for n in names() if issubclass(find(n), Row)} == {m.__name__ for m in own_modules()}


def test_a_stub_has_the_signature_of_each_row():
    """Read back without any of our code."""
    seen = set()
    for module in own_modules():
        for node in ast.parse(Path(inspect.getfile(module)).with_suffix(".pyi").read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                cls = getattr(module, node.name)
                (made,) = (f for f in node.body if isinstance(f, ast.FunctionDef))
                stub = {a.arg: ast.literal_eval(d) for a, d in zip(made.args.kwonlyargs, made.args.kw_defaults)}
                assert stub == {p.name: p.default for p in inspect.signature(cls).parameters.values()}
                seen.add(cls.name)
    assert seen >= {n for n in names() if issubclass(find(n), Row)}


@pytest.mark.usefixtures("clean_registry")
def test_a_file_that_needs_no_stub_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "plain.py"
    path.write_text("x = 1\n")
    assert main([str(path)]) == 1
    assert main([str(tmp_path / "absent.py")]) == 1
    assert main(["simnav.absent"]) == 1
    said = capsys.readouterr().err.splitlines()
    assert "plain.py: it declares no row, so that it needs no stub" in said[0]
    assert "absent.py: it cannot be imported" in said[1]
    assert "simnav.absent: it cannot be imported: No module named 'simnav.absent'" in said[2]
    assert not list(tmp_path.glob("*.pyi"))


def test_an_editor_shows_the_parameters():
    jedi = pytest.importorskip("jedi")
    source = "from simnav.estimators.rows.kalman import Ekf\nEkf("
    project = jedi.Project(ROOT)
    (signature,) = jedi.Script(source, project=project).get_signatures(2, 4)
    assert [p.name for p in signature.params] == ["calibrate", "iterate_above_deg"]
    assert signature.params[0].to_string() == "calibrate: bool=True"


def test_documentation_shows_the_parameters():
    griffe = pytest.importorskip("griffe")
    module = griffe.load("simnav.estimators.rows.kalman", search_paths=[str(ROOT)])
    parameters = {p.name: str(p.annotation) for p in module["Ekf"].parameters}
    assert parameters == {"self": "None", "calibrate": "bool", "iterate_above_deg": "float | None"}
    assert "15-state error-state EKF" in module["Ekf"].docstring.value
