"""Rows as declarations: their parameters, their documentation, what fits together, and that nothing was lost."""

from __future__ import annotations

import copy
import inspect
import json
import pickle
import re
import subprocess
import sys
import typing
from functools import cache
from pathlib import Path

import cloudpickle
import numpy as np
import pytest

from simnav.estimator import EstimatorError, describe, find, make, names, register
from simnav.estimator.parameters import former_names
from simnav.estimators.adaptations.adkf import AdaptiveFactor
from simnav.estimators.adaptations.fading import FadingMemory
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.adaptations.innovation_based import InnovationBased
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.adaptations.truth import TrueNoise
from simnav.estimators.adaptations.variational_bayes import VariationalBayes
from simnav.estimators.composition import Row, Solver, documented, piece
from simnav.estimators.models.chain import chain_of
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.estimators.models.kinematic import KinematicModel
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.models.unaided import UnaidedModel
from simnav.estimators.rows.kalman import Ekf
from simnav.estimators.solvers.dead_reckoning import DeadReckoningEstimator
from simnav.estimators.solvers.federated import FederatedEstimator
from simnav.estimators.solvers.filterpy_unscented import FilterpyUnscentedEstimator
from simnav.estimators.solvers.full_graph import FullGraph
from simnav.estimators.solvers.gtsam_solvers import FixedLagEstimator
from simnav.estimators.solvers.heading_bank import HeadingBank
from simnav.estimators.solvers.imm import ImmEstimator
from simnav.estimators.solvers.invariant import InvariantKalmanEstimator
from simnav.estimators.solvers.iterated import Iteration
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.linear import LinearKalmanEstimator
from simnav.estimators.solvers.oracle import OracleEstimator
from simnav.estimators.solvers.sigma_point import SigmaPointEstimator
from simnav.estimators.solvers.smoother import Smoother
from simnav.estimators.solvers.solution_separation import SolutionSeparation
from simnav.estimators.solvers.weighted import WeightedKalmanEstimator
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.gradient_adaptive import GradientAdaptive
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial

#: Names, aliases, parameters and defaults of the rows before they were declarations.
RECORDED = json.loads((Path(__file__).parent / "recorded_rows.json").read_text())


class Gated(Row, solver=KalmanEstimator, model=InertialModel, adaptation=ChiSquareGate):
    """A gated filter."""


@pytest.mark.parametrize("name", RECORDED)
def test_every_name_alias_parameter_and_default_is_still_there(name: str):
    told, now = RECORDED[name], describe(name)
    assert sorted(now.aliases) == told["aliases"]
    assert (now.slow, now.reference) == (told["slow"], told["reference"])
    defaults = {p.name: list(p.default) if isinstance(p.default, tuple) else p.default for p in now.parameters}
    formerly = former_names(now.cls)
    assert {n: defaults[formerly.get(n, n)] for n in told["parameters"]} == told["parameters"]


def test_the_same_noise_has_the_same_parameters_in_a_filter_and_in_a_window():
    filters, windows = ({p.name for p in describe(n).parameters} for n in ("iae", "iae-fgo"))
    noise = set(inspect.signature(InnovationBased).parameters) - {"source"}
    assert noise <= filters
    assert noise <= windows


@pytest.mark.parametrize("name", RECORDED)
def test_every_parameter_is_documented_and_every_row_says_whose_it_is(name: str):
    cls = find(name)
    meanings = documented(cls)
    for parameter in describe(name).parameters:
        assert meanings[parameter.name][1], parameter.name
    text = inspect.getdoc(cls)
    assert re.search(r"(?s)\bSource:|FGO.* of [A-Z]\. ", text)
    assert not re.search(r"paper 00\d", text.split("Parameters\n")[0])


def test_what_a_piece_documents_together_stays_together():
    assert "\nlowest, highest : float\n" in inspect.getdoc(find("iae"))
    assert documented(find("iae"))["lowest"] == documented(find("iae"))["highest"]


@pytest.mark.parametrize("name", names())
def test_an_estimator_and_its_class_can_be_pickled(name: str):
    cls = pickle.loads(pickle.dumps(find(name)))
    assert cls is find(name)
    for row in (pickle.loads(pickle.dumps(make(name))), copy.deepcopy(make(name))):
        assert type(row) is cls
        assert not isinstance(getattr(row, "solver", None), Solver) or row.solver.row == name


def test_a_row_of_a_session_can_be_sent_to_another_process():
    code = (
        "import sys, pickle, inspect; cls, row = pickle.loads(sys.stdin.buffer.read());"
        "assert row.adaptation.probability == 0.9 and type(row) is cls, row;"
        "assert inspect.signature(cls).parameters['probability'].annotation is float;"
        "assert cls(patience=3.0).adaptation.patience == 3.0"
    )

    class Sent(Row, solver=KalmanEstimator, model=InertialModel, adaptation=ChiSquareGate):
        """Known to this process only."""

    sent = cloudpickle.dumps((Sent, Sent(probability=0.9)))
    subprocess.run([sys.executable, "-c", code], input=sent, check=True)


@pytest.mark.parametrize("name", [n for n in names() if issubclass(find(n), Row)])
def test_the_signature_of_a_row_has_types_and_defaults_and_is_meant(name: str):
    cls = find(name)
    signature = inspect.signature(cls)
    hints = typing.get_type_hints(cls.__init__)
    values = {}
    for parameter in signature.parameters.values():
        assert parameter.kind is parameter.KEYWORD_ONLY
        assert parameter.annotation == hints[parameter.name]
        assert not isinstance(parameter.annotation, str)
        values[parameter.name] = parameter.default
    assert type(cls(**values)) is cls
    with pytest.raises(TypeError, match="has no parameter 'oar'"):
        cls(oar=1)


def test_a_row_has_what_its_solver_has():
    row = Ekf(calibrate=False)
    assert row.model is row.solver.model
    assert not row.model.calibrate
    with pytest.raises(AttributeError, match="absent"):
        _ = row.absent


@pytest.mark.usefixtures("clean_registry")
def test_a_file_registers_and_sets_parameters(tmp_path: Path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from simnav import register\n"
        "from simnav.estimators.composition import Row\n"
        "from simnav.estimators.adaptations.sage_husa import SageHusa\n"
        "from simnav.estimators.models.inertial_points import InertialPoints\n"
        "from simnav.estimators.solvers.sigma_point import SigmaPointEstimator\n\n\n"
        "class SageHusaUkf(Row, solver=SigmaPointEstimator, model=InertialPoints, adaptation=SageHusa):\n"
        '    """Sage-Husa noise in an unscented filter."""\n'
    )
    made = make(f"{path}:SageHusaUkf", fading="0.9", scope="all", alpha="0.4")
    assert (made.adaptation.fading, made.adaptation.scope, made.alpha) == (0.9, "all", 0.4)
    assert describe(str(path)).summary == "Sage-Husa noise in an unscented filter."
    with pytest.raises(EstimatorError, match="no parameter 'fadin'; did you mean 'fading'"):
        make(str(path), fadin=0.9)
    with pytest.raises(EstimatorError, match=r"'scope' of estimator 'sage-husa-ukf' is one of fixes, all"):
        make(str(path), scope="some")
    with pytest.raises(EstimatorError, match=r"fading = 2: it must lie in \(0, 1\]"):
        make(str(path), fading=2.0)


def test_a_subclass_exchanges_a_piece_or_adds_a_parameter():
    class Other(Gated, adaptation=SageHusa):
        """Another."""

    class More(Gated):
        def __init__(self, extra: int = 3, **options):
            super().__init__(**options)
            self.extra = extra

    assert "probability" not in inspect.signature(Other).parameters
    assert isinstance(Other(prior=3).adaptation, SageHusa)
    assert More(probability=0.9).adaptation.probability == 0.9


def test_pieces_are_changed_for_a_row():
    class Changed(
        Row,
        solver=piece(WindowEstimator, defaults={"window": 7}, spacing=0.5),
        model=InertialModel,
        adaptation=VariationalBayes,
    ):
        """Changed."""

    parameters = inspect.signature(Changed).parameters
    assert not {"spacing", "iterations"} & set(parameters)
    both = parameters["adaptation__iterations"].default, parameters["solver__iterations"].default
    assert (parameters["window"].default, *both) == (7, 2, 10)
    row = Changed(adaptation__iterations=4, solver__iterations=6)
    assert (row.window, row.spacing, row.adaptation.iterations, row.iterations) == (7, 0.5, 4, 6)
    assert Changed().window == 7
    assert "alternating" not in documented(Changed)["solver__iterations"][1]
    assert documented(Changed)["adaptation__iterations"] == documented(VariationalBayes)["iterations"]


class Former(Gated):
    """The gate, whose parameter had another name."""

    formerly = {"limit": "probability", "patience": "probability", "gone": "away"}  # noqa: RUF012


def test_a_former_name_is_read_where_no_parameter_has_it():
    assert Former(limit=0.9).adaptation.probability == 0.9
    assert Former(patience=3.0).adaptation.patience == 3.0  # it is a parameter
    with pytest.raises(EstimatorError, match="Former: 'limit' is the former name of 'probability'; give one of them"):
        Former(limit=0.9, probability=0.9)
    with pytest.raises(TypeError, match="has no parameter 'gone'; it has probability, patience"):
        Former(gone=1)

    class Other(Former, adaptation=SageHusa):
        """It has no such parameter."""

    with pytest.raises(TypeError, match="has no parameter 'limit'"):
        Other(limit=1)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("iae-fixed", {"window": "9"}, {"innovations": 9}),
        ("rae", {"window": "9"}, {"innovations": 9}),
        ("student-t-rts", {"dof": "5", "smoothed_dof": "4"}, {"adaptation__dof": 5.0, "smoother__dof": 4.0}),
    ],
)
def test_former_names_of_our_rows_are_read(name: str, old: dict, new: dict):
    assert not set(old) & set(inspect.signature(find(name)).parameters)
    made = make(name, **old), make(name, **new), find(name)(**{k: float(v) for k, v in old.items()}), make(name)
    for part in ("adaptation", "smoother") if "smoother" in find(name).recipe else ("adaptation",):
        former, present, called, plain = (vars(getattr(row.solver, part)) for row in made)
        assert former == present == called != plain


def test_what_does_not_fit_is_said_where_it_is_declared():
    with pytest.raises(TypeError, match="Wrong: ImmEstimator takes no adaptation: the noise of each measurement is a"):
        type(Row)("Wrong", (Row,), {}, solver=ImmEstimator, model=Suitable, adaptation=SageHusa)
    with pytest.raises(TypeError, match="Odd: KalmanEstimator takes no oar: it takes model, adaptation"):
        type(Row)("Odd", (Row,), {}, solver=KalmanEstimator, model=Suitable, oar=SageHusa)
    with pytest.raises(TypeError, match="FadingMemory has no parameter 'memroy'; it has memory"):
        type(Row)("Typo", (Row,), {}, solver=KalmanEstimator, model=Suitable, adaptation=piece(FadingMemory, memroy=1))
    with pytest.raises(TypeError, match="Gated has no parameter 'limit'; it has probability, patience"):
        Gated(limit=3.0)


@pytest.mark.parametrize("solver", [LinearKalmanEstimator, InvariantKalmanEstimator, SigmaPointEstimator,
                                    FederatedEstimator, WindowEstimator, FullGraph, FixedLagEstimator])  # fmt: skip
def test_a_solver_that_cannot_smooth_says_why(solver: type):
    if solver is FixedLagEstimator:
        assert solver.refuses["adaptation"]
        return
    with pytest.raises(TypeError, match=r"takes no smoother: (?!it takes)"):
        type(Row)("Smoothed", (Row,), {}, solver=solver, model=InertialModel, smoother=Smoother)


@pytest.mark.parametrize(
    ("pieces", "says"),
    [
        ({"solver": SigmaPointEstimator, "model": InertialModel}, "it moves no sigma points; InertialPoints and"),
        ({"solver": InvariantKalmanEstimator, "model": Suitable}, "its group has position, velocity and attitude"),
        ({"solver": FederatedEstimator, "model": ShipModel}, "its local filters share the motion of an InertialModel"),
        ({"solver": FederatedEstimator, "model": NineStateModel}, "have the biases of the IMU among their states"),
        ({"solver": FederatedEstimator, "model": UnaidedModel}, "this model observes none"),
        ({"solver": FilterpyUnscentedEstimator, "model": InertialPoints}, "is given the functions of ShipPoints"),
        ({"solver": OracleEstimator, "adaptation": SageHusa}, "an oracle is told the noise, and estimates none"),
        ({"solver": KalmanEstimator, "model": Suitable, "adaptation": TrueNoise}, "it reads the truth of a run"),
        ({"solver": WindowEstimator, "model": Suitable, "adaptation": TrueNoise}, "it reads the truth of a run"),
        ({"solver": FullGraph, "model": Suitable, "adaptation": FadingMemory}, "inflates the covariance of the pred"),
    ],
)
def test_pieces_that_do_not_fit_say_so_where_the_row_is_declared(pieces: dict, says: str):
    *_, last = (p.__name__ for p in pieces.values())
    with pytest.raises(TypeError, match=rf"Unfit: {pieces['solver'].__name__} does not work with {last}: .*{says}"):
        type(Row)("Unfit", (Row,), {}, **pieces)
    keyword = list(pieces)[-1]
    row = type(Row)("Unfit", (Row,), {}, **{**pieces, keyword: lambda: pieces[keyword]()})
    with pytest.raises(TypeError, match=says):  # what a function makes is known when the row is made
        row()


def test_a_row_without_a_piece_that_its_solver_needs_says_so():
    base = type(Row)("Base", (Row,), {}, solver=WeightedKalmanEstimator, model=Suitable)
    with pytest.raises(TypeError, match="Base names no weighting, and WeightedKalmanEstimator needs one"):
        base()
    assert type(Row)("Whole", (base,), {}, weighting=GradientAdaptive)().solver.weighting is not None


@pytest.mark.parametrize(
    "solver", [DeadReckoningEstimator, FixedLagEstimator, FilterpyUnscentedEstimator, HeadingBank, SolutionSeparation]
)
@pytest.mark.parametrize("keyword", ["adaptation", "weighting", "isolation", "iteration", "smoother"])
def test_a_solver_without_a_piece_says_why(solver: type, keyword: str):
    with pytest.raises(TypeError, match=rf"takes no {keyword}: (?!it takes)"):
        type(Row)("Refused", (Row,), {}, solver=solver, **{keyword: SageHusa})


@pytest.mark.parametrize(
    "pieces",
    [
        {"solver": LinearKalmanEstimator},
        {"solver": SolutionSeparation},
        {"solver": KalmanEstimator, "iteration": piece(Iteration, above_deg=0.0)},
        {"solver": KalmanEstimator, "smoother": Smoother},
    ],
    ids=["linear", "separation", "iterated", "smoothed"],
)
def test_a_linear_model_that_observes_fixes_only_gives_the_same_in_every_filter(pieces: dict):
    recording = record(load("ship-straight").model_copy(update={"duration": 20.0}), 3)
    trial = run_trial(type(Row)("Fixes", (Row,), {}, model=KinematicModel, **pieces)(), recording)
    assert trial.status == "ok", trial.reason
    plain = run_trial(type(Row)("Plain", (Row,), {}, solver=KalmanEstimator, model=KinematicModel)(), recording)
    np.testing.assert_allclose(trial.velocity, plain.velocity, atol=1e-4)
    np.testing.assert_allclose(trial.position, plain.position, atol=1e-9)


def test_a_model_that_does_not_name_its_state_says_so():
    class Nameless(KinematicModel):
        state = ()

    with pytest.raises(TypeError, match=r"Nameless\.state is to name the arrays that `correct` changes"):
        Nameless().snapshot()


@pytest.mark.parametrize("adaptation", [FadingMemory(), AdaptiveFactor(target="P")])
def test_a_window_refuses_what_inflates_a_prediction(adaptation):
    with pytest.raises(ValueError, match="inflates the covariance of the prediction"):
        WindowEstimator(InertialModel(), adaptation)
    WindowEstimator(InertialModel(), AdaptiveFactor())  # doubts the motion, which a window weighs by itself


def test_isolation_is_a_piece_of_windows_with_a_weighting():
    class Isolated(
        Row, solver=WindowEstimator, model=InertialModel, weighting=GradientAdaptive, isolation=FaultIsolation
    ):
        """Gradient-adaptive weights with the isolation of faults, which has parameters of its own."""

    row = Isolated(together=5)
    assert (row.isolation.together, row.isolation.recent) == (5, 5.0)
    assert "times in a row" in documented(Isolated)["together"][1]
    with pytest.raises(TypeError, match="takes no isolation: a filter sees one measurement at a time"):
        type(Row)("Filter", (Row,), {}, solver=KalmanEstimator, model=InertialModel, isolation=FaultIsolation)
    with pytest.raises(ValueError, match="FaultIsolation changes weights, and there is no weighting"):
        WindowEstimator(InertialModel(), isolation=FaultIsolation())


def test_a_model_without_a_chain_makes_no_graph():
    with pytest.raises(TypeError, match="KinematicModel has no function `difference` of two states, so that no graph"):
        WindowEstimator(KinematicModel())
    with pytest.raises(TypeError, match="object has no chain, so that no graph can be made of it"):
        chain_of(object())


FILTERS = {
    "kalman": (KalmanEstimator, InertialModel),
    "linear": (LinearKalmanEstimator, InertialModel),
    "invariant": (InvariantKalmanEstimator, InertialModel),
    "sigma-point": (SigmaPointEstimator, InertialPoints),
    "federated": (FederatedEstimator, InertialModel),
    "window": (WindowEstimator, InertialModel),
    "full": (FullGraph, InertialModel),
}


@pytest.fixture(scope="module")
def recording():
    return record(load("harbour-multipath").model_copy(update={"duration": 20.0}), 3)


@pytest.fixture(scope="module")
def plain(recording):
    """The trial of each solver without an adaptation."""

    @cache
    def run(solver: str):
        make_solver, model = FILTERS[solver]
        return run_trial(type(Row)("Plain", (Row,), {}, solver=make_solver, model=model)(), recording)

    return run


@pytest.mark.parametrize("noise", [SageHusa, InnovationBased, ChiSquareGate])
@pytest.mark.parametrize("solver", FILTERS)
def test_any_adaptation_works_with_any_solver(recording, plain, solver: str, noise: type):
    """It is asked (it changes the estimate's report of sigmas), and the estimate stays sound."""
    make_solver, model = FILTERS[solver]
    row = type(Row)("Any", (Row,), {}, solver=make_solver, model=model, adaptation=noise)
    trial = run_trial(row(), recording)
    assert trial.status == "ok", trial.reason
    assert np.isfinite(trial.diagnostics["sigma_north.gnss"]).all()
    assert "sigma_north.gnss" not in plain(solver).diagnostics
    assert np.linalg.norm(trial.velocity - plain(solver).velocity, axis=1).max() < 3.0


@pytest.mark.usefixtures("clean_registry")
def test_a_new_row_is_short():
    """Every declaration of ours has at most ten lines; its docstring and its version aside, which have its history."""
    for name in names():
        body = re.sub(r'"""(?s:.*?)"""|^    version = .*', "", inspect.getsource(find(name)), flags=re.MULTILINE)
        assert len([line for line in body.splitlines() if line.strip()]) <= 10, name


@pytest.mark.usefixtures("clean_registry")
def test_a_declaration_in_a_module_is_registered_with_its_place():
    registered = register("a-gated-one")(Gated)
    assert describe("a-gated-one").line > 0
    assert registered.name == "a-gated-one"
