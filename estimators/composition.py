"""Declaration of rows: a solver and its pieces, whose parameters become those of the row.

A row is a class without a body::

    @register("gated-ukf")
    class GatedUkf(Row, solver=SigmaPointEstimator, model=InertialPoints, adaptation=ChiSquareGate):
        \"\"\"Unscented Kalman filter that leaves out measurements whose innovation is improbable.\"\"\"

Every piece is a class, or a function that makes one. Its constructor defines the parameters, and its docstring
documents them, in this one place only. `piece` changes a piece for a row: it fixes parameters, or gives parameters
another default. Where two pieces have a parameter of the same name, the row has it twice, with the keyword of the
piece before it: ``adaptation__dof`` and ``smoother__dof``.

The constructor of a row is made when the class is defined. Type checkers and editors read it from the stub file
beside the module, which `simnav.estimators.stubs` writes.
"""

from __future__ import annotations

import contextlib
import inspect
import re
import typing
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar

from simnav.estimates import Estimates
from simnav.estimator import Estimator, Needs, UnsuitableScenario, lacking
from simnav.estimator.late_arrivals import (
    LateArrivals,
    Manner,
    TrueTimes,
    are_untimely,
    is_untimely,
    parts_of,
    true_times,
)
from simnav.estimator.parameters import former_names, under_present_names
from simnav.steps import Steps
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements, NavigationStates

from .coarse_alignment import CoarseAlignment
from .fix_test import FixTest
from .range_test import RangeTest

if typing.TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["Piece", "Row", "Solver", "piece"]


class Solver(Estimator):
    """Base of the estimators that are composed of pieces.

    Attributes
    ----------
    pieces : tuple of str
        Parameters of the constructor that are pieces.
    refuses : mapping of str to str
        Pieces with which this solver cannot work, with the reason.
    row : str
        Name of the row that uses the solver, for messages. A solver that is registered itself has its own name.
    reports_all : bool
        If it is set to True before `reset`, Kalman filters and windows report all states of instruments by name, biases
        and scale factors too (`simnav.types.Estimate.states`). For a row: ``row.solver.reports_all = True``.
    """

    pieces: ClassVar[tuple[str, ...]] = ()
    refuses: ClassVar[Mapping[str, str]] = {}
    row: str = ""
    reports_all: bool = False
    #: False for a solver that takes its moments from points or particles.
    linearises: ClassVar[bool] = True
    #: True for a solver that searches an unknown heading by itself, so that its row does not wait for one.
    searches_heading: ClassVar[bool] = False

    @classmethod
    def misfit(cls, keyword: str, made: type) -> str:
        """Why it cannot work with a piece of a class; empty where it can.

        Parameters
        ----------
        keyword : str
            One of `pieces`.
        made : type
            Class of the piece.
        """
        if getattr(made, "reads_truth", False) and not cls.reference:
            return "it reads the truth of a run, which only an oracle is given"
        return ""

    @property
    def label(self) -> str:
        """Name of the solver in messages."""
        return self.row or self.name

    @property
    def needs(self) -> Needs:
        """The instruments that its model needs."""
        own = vars(self)
        model = own.get("_model_choice", own.get("model"))
        found: Needs = () if model is None else model.needs
        return found

    def observes(self, instruments: Instruments) -> Collection[str] | None:
        """The instruments that its model observes; None without a model, and for a model that is unaided by design."""
        choice = vars(self).get("_model_choice", vars(self).get("model"))
        if choice is None:
            return None
        model = choice.choose(instruments, self.label)
        return None if model.unaided else {name for name, sheet in instruments.items() if model.observes(sheet)}


@dataclass(frozen=True)
class Piece:
    """A piece as a row uses it; `piece` makes one.

    Attributes
    ----------
    make : callable
        The class of the piece, or a function that returns one.
    fixed : mapping
        Parameters with a value that the row fixes; they are not parameters of the row.
    defaults : mapping
        Defaults of the row, in place of those of the constructor.
    """

    make: Callable[..., Any]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    defaults: Mapping[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Name of the class."""
        return getattr(self.make, "__name__", repr(self.make))

    def parameters(self) -> dict[str, inspect.Parameter]:
        """What a row takes for it, by the constructor's names, with the types of the constructor.

        Raises
        ------
        TypeError
            If a parameter that is fixed or given a default is none of the constructor's.
        """
        known = {p.name: p for p in inspect.signature(self.make).parameters.values() if p.kind in _NAMED}
        for name in (*self.fixed, *self.defaults):
            if name not in known:
                raise TypeError(f"{self.label} has no parameter {name!r}; it has {', '.join(known) or 'none'}")
        inner, types = getattr(self.make, "pieces", ()), _hints(self.make)
        return {
            name: p.replace(
                kind=inspect.Parameter.KEYWORD_ONLY,
                annotation=types.get(name, p.annotation),
                default=self.defaults.get(name, p.default),
            )
            for name, p in known.items()
            if name not in self.fixed and name not in inner
        }

    def build(self, values: Mapping[str, Any], **pieces: Any) -> Any:
        """The piece, with values of its parameters."""
        return self.make(**pieces, **{**self.fixed, **self.defaults, **values})


#: The kinds of instruments that solve the raw readings of another one.
_SOLUTIONS = ("gnss_receiver", "dvl_solution", "dvl_water_solution", "terrain_match")
_NAMED = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


def piece(
    make: Callable[..., Any],
    *,
    defaults: Mapping[str, Any] | None = None,
    **fixed: Any,
) -> Piece:
    """A piece of a row, changed for it.

    Parameters
    ----------
    make : callable
        The class of the piece, or a function that returns one.
    defaults : mapping, optional
        Defaults of the row, by the names of the constructor's parameters.
    **fixed
        Parameters with a value that the row fixes; they are not parameters of the row.

    Examples
    --------
    >>> from simnav.estimators.adaptations.fading import FadingMemory
    >>> slow = piece(FadingMemory, defaults={"memory": 5000.0})
    >>> slow.build({}).memory, slow.build({"memory": 60.0}).memory
    (5000.0, 60.0)
    """
    return Piece(make, fixed, defaults or {})


class Row(Estimator):
    """Base of the rows: an estimator that is a solver with its pieces, named as keywords of the class.

    A subclass of a row that names pieces is the same row with these pieces replaced. The docstring of the class says
    what the row is, and its source; the documentation of the parameters is added from the docstrings of the pieces.

    Attributes
    ----------
    recipe : mapping of str to Piece
        The pieces: ``solver``, and the pieces of the solver.
    loose : bool
        True for a row that takes the solution of a receiver in place of the raw observations which it solves
        (`simnav.estimators.models.coupling`). Such a row needs a receiver. Any row is one if it is made with ``loose``
        (`simnav.estimator.make`).
    solver : Estimator
        The solver with its pieces. Its attributes are also attributes of the row: ``row.model``, ``row.covariance``.

    Raises
    ------
    TypeError
        When the class is defined: if the solver does not take a piece, or cannot work with it. When it is made: if the
        solver needs a piece that the row does not name.
    """

    recipe: ClassVar[Mapping[str, Piece]] = {}
    loose: bool = False
    solver: Estimator
    #: What is done with readings that arrive late: the parameter ``late`` of `simnav.estimator.make`.
    late: Manner = "replay"
    _late: LateArrivals | None = None
    _tests: Sequence[FixTest | RangeTest] = ()
    _alignment: CoarseAlignment | None = None
    _truth: TrueTimes | None = None
    _shared: Sequence[object] = ()

    def __init__(self, **parameters: Any):  # type checkers see it where a row has no stub
        raise TypeError(f"{type(self).__name__} names no solver")

    def __init_subclass__(cls, **pieces: Callable[..., Any] | Piece):
        super().__init_subclass__()
        if not pieces:
            return
        wrapped = {name: p if isinstance(p, Piece) else Piece(p) for name, p in pieces.items()}
        cls.recipe = {**cls.recipe, **wrapped}
        solver = cls.recipe["solver"]
        taken: tuple[str, ...] = getattr(solver.make, "pieces", ())
        for name in cls.recipe:
            if name != "solver" and name not in taken:
                reasons: Mapping[str, str] = getattr(solver.make, "refuses", {})
                why = reasons.get(name, f"it takes {', '.join(taken) or 'none'}")
                raise TypeError(f"{cls.__name__}: {solver.label} takes no {name}: {why}")
        for name, each in cls.recipe.items():
            if name != "solver" and isinstance(each.make, type):
                _require_fit(cls, name, each.make)
        for flag in ("slow", "reference"):
            if flag not in vars(cls):
                setattr(cls, flag, getattr(solver.make, flag, False))
        if "real_time_as" not in vars(cls):  # a smoother alone changes nothing in real time
            parent = cls.__mro__[1]
            only = set(wrapped) == {"smoother"} and "smoother" not in getattr(parent, "recipe", {})
            cls.real_time_as = getattr(parent, "name", "") if only else ""
        _equip(cls)

    @property
    def sets_aside(self) -> bool:
        """Whether the row may use a measurement with less weight than its datasheet says, or not at all."""
        if self.reference:
            return False
        return bool({"adaptation", "weighting"} & self.recipe.keys()) or getattr(self.solver, "sets_aside", False)

    @property
    def linearises(self) -> bool:
        """Whether the row uses a reading by its derivatives at the row's own estimate."""
        return not self.reference and getattr(self.solver, "linearises", True)

    @property
    def needs(self) -> Needs:
        """The instruments that its solver needs; and one that solves raw readings, if it is loosely coupled."""
        return (*self.solver.needs, _SOLUTIONS) if self.loose else self.solver.needs

    def observes(self, instruments: Instruments) -> Collection[str] | None:
        """The instruments that its solver uses; without raw readings that are solved, if it is loosely coupled."""
        return self.solver.observes(self._used(instruments))

    def _used(self, instruments: Instruments) -> Instruments:
        """Those that the solver is given."""
        if not self.loose:
            return instruments
        return instruments.without({name for sheet in instruments.values() for name in sheet.sources})

    @property
    def trained_on(self) -> Mapping[str, Any]:
        """The record of the training of a piece that learned; empty if none did."""
        pieces = (vars(self.solver).get(name) for name in self.recipe)
        return next((record for piece in pieces if (record := getattr(piece, "trained_on", None))), {})

    @property
    def learned_from(self) -> Sequence[tuple[int, int]]:
        """The random streams of the training voyages, as their record tells them."""
        return [(int(first), int(last)) for first, last in self.trained_on.get("streams", ())]

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario where the pieces lack an instrument."""
        if self.loose and (lack := lacking((_SOLUTIONS,), instruments)):
            raise UnsuitableScenario(f"{self.name}: {lack}")
        self._instruments = instruments = self._used(instruments)
        self._late = self._late_arrivals() if any(sheet.timing for sheet in instruments.values()) else None
        self._tests = self._self_tests(instruments)
        self.solver.reset(start, instruments)
        self._alignment = CoarseAlignment(start, instruments) if self._waits(start) else None

    def _self_tests(self, instruments: Instruments) -> Sequence[FixTest | RangeTest]:
        """What the row tests of itself beside what its solver tests."""
        tests: list[FixTest | RangeTest] = [FixTest(instruments)] if self.sets_aside else []
        ranges = RangeTest(instruments)
        return [*tests, ranges] if ranges and self.linearises else tests

    def _waits(self, start: InitialState) -> bool:
        """Whether the row cannot begin before it knows its attitude."""
        searched = start.unknown == "heading" and getattr(self.solver, "searches_heading", False)
        return bool(start.unknown) and not searched and not self.reference and self._instruments.imu is not None

    def _late_arrivals(self) -> LateArrivals:
        return LateArrivals(self._instruments, self.late, self._truth, self._shared)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time, also those that arrive late."""
        alignment = self._alignment
        if alignment is None:
            return self._take(measurements)
        estimate = alignment.update(measurements)
        if alignment.aligned:
            self._alignment = None
            self.solver.reset(alignment.start, self._instruments)
            for packet in alignment.packets:
                estimate = self._take(packet)
        return estimate

    def _take(self, measurements: Measurements) -> Estimate:
        """Take the measurements of a step of a row that has begun."""
        if self._late is None and is_untimely(measurements):
            self._late = self._late_arrivals()
        if self._late is None:
            estimate = self.solver.update(measurements)
        else:
            self.solver, estimate = self._late.update(self.solver, measurements)
        for test in self._tests:
            estimate = test.judge(measurements, estimate)
        return estimate

    def update_all(self, steps: Steps) -> Estimates | None:
        """Take several steps by one call, if the solver does and no reading is late."""
        if self._late is not None or type(self).update is not Row.update or are_untimely(steps):
            return None
        estimates = self.solver.update_all(steps)
        if estimates is not None:
            for test in self._tests:
                test.judge_all(steps, estimates)
        return estimates

    def smooth(self) -> NavigationStates | None:
        """The trajectory of a solver that smooths; else None."""
        return None if self._alignment is not None else self.solver.smooth()

    def earlier(self, lags: Sequence[float]) -> Array | None:
        """The states of earlier times of a solver that looks back; else None."""
        return None if self._alignment is not None else self.solver.earlier(lags)

    def longest_lag(self, instruments: Instruments) -> float:
        """How far a solver looks back [s]."""
        return self.solver.longest_lag(instruments)

    def reveal(self, recording: Recording) -> None:
        """Pass the truth to a solver that is a reference."""
        self._truth = true_times(recording) or None
        if self._truth is not None:
            self._shared = parts_of(recording)
        self.solver.reveal(recording)

    def __getattr__(self, name: str) -> Any:
        if name == "solver" or name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.solver, name)


def _require_fit(cls: type[Row], keyword: str, made: Any) -> None:
    """Refuse a piece of a class that the solver of a row cannot work with: TypeError."""
    solver = cls.recipe["solver"]
    misfit: Callable[[str, Any], str] | None = getattr(solver.make, "misfit", None)
    why = misfit(keyword, made) if misfit is not None else ""
    if why:
        raise TypeError(f"{cls.__name__}: {solver.label} does not work with {made.__name__}: {why}")


def _equip(cls: type[Row]) -> None:
    """Add the constructor to a row, and the documentation of its parameters."""
    recipe = cls.recipe
    order = [name for name in ("adaptation", "weighting", "isolation") if name in recipe]
    order += [name for name in recipe if name not in (*order, "solver")]
    inner = {keyword: recipe[keyword].parameters() for keyword in (*order, "solver")}
    count = Counter(name for own in inner.values() for name in own)
    parameters: dict[str, inspect.Parameter] = {}
    place: dict[str, tuple[str, str]] = {}  # keyword of the piece, and name in its constructor
    documentation: list[tuple[str, str, str]] = []
    for keyword, own in inner.items():
        meanings = documented(recipe[keyword].make)
        for each, parameter in own.items():
            name = each if count[each] == 1 else f"{keyword}__{each}"
            parameters[name], place[name] = parameter.replace(name=name), (keyword, each)
            sort, meaning = meanings.get(each, ("", ""))
            if documentation and documentation[-1][1:] == (sort, meaning):  # documented together
                documentation[-1] = f"{documentation[-1][0]}, {name}", sort, meaning
            else:
                documentation.append((name, sort, meaning))

    lacking = [name for name in _required(recipe["solver"]) if name not in recipe]

    def __init__(self: Row, **values: Any) -> None:  # noqa: N807 (it becomes the class's)
        values = under_present_names(former_names(type(self)), values, type(self).__name__)
        settings: dict[str, dict[str, Any]] = {keyword: {} for keyword in recipe}
        for name, value in values.items():
            if name not in place:
                raise TypeError(f"{cls.__name__} has no parameter {name!r}; it has {', '.join(place) or 'none'}")
            keyword, each = place[name]
            settings[keyword][each] = value
        parts = {name: p.build(settings[name]) for name, p in recipe.items() if name != "solver"}
        for name, part in parts.items():
            if part is not None and not isinstance(recipe[name].make, type):  # a function has made it
                _require_fit(type(self), name, type(part))
        for name in lacking:
            raise TypeError(f"{cls.__name__} names no {name}, and {recipe['solver'].label} needs one")
        self.solver = recipe["solver"].build(settings["solver"], **parts)
        if isinstance(self.solver, Solver):
            self.solver.row = type(self).name

    __init__.__qualname__, __init__.__module__ = f"{cls.__qualname__}.__init__", cls.__module__
    __init__.__annotations__ = {n: p.annotation for n, p in parameters.items() if p.annotation is not p.empty}
    own_self = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    __init__.__signature__ = inspect.Signature([own_self, *parameters.values()])  # type: ignore[attr-defined]
    cls.__init__ = __init__  # type: ignore[method-assign]
    text = inspect.cleandoc(vars(cls).get("__doc__") or "")
    if documentation:
        text += "\n\nParameters\n----------"
    for names, sort, meaning in documentation:
        text += f"\n{names} : {sort}" if sort else f"\n{names}"
        text += "".join(f"\n    {line}" for line in meaning.splitlines())
    cls.__doc__ = text


def _required(solver: Piece) -> list[str]:
    """The pieces that a solver cannot do without."""
    known = inspect.signature(solver.make).parameters
    inner: tuple[str, ...] = getattr(solver.make, "pieces", ())
    return [name for name in inner if name in known and known[name].default is inspect.Parameter.empty]


@cache
def _hints(make: Callable[..., Any]) -> dict[str, Any]:
    """The types of a constructor's parameters; none where an annotation cannot be resolved."""
    plain = isinstance(make, type) and make.__init__ is not object.__init__  # type: ignore[misc]
    with contextlib.suppress(Exception):
        return typing.get_type_hints(make.__init__ if plain else make)
    return {}


@cache
def documented(make: Callable[..., Any]) -> dict[str, tuple[str, str]]:
    """Type and meaning of parameters from numpydoc docstrings, by name; those of a class before those of its bases.

    An entry without a type, as "window, tolerance / As for `WindowEstimator`.", refers to the documentation of a base,
    and counts where there is none.

    Parameters
    ----------
    make : callable
        A class or a function.
    """
    found: dict[str, tuple[str, str]] = {}
    references: dict[str, tuple[str, str]] = {}
    for each in make.__mro__ if isinstance(make, type) else (make,):
        text = inspect.cleandoc(vars(each).get("__doc__") or "") if isinstance(each, type) else inspect.getdoc(each)
        for section in re.findall(
            r"^(?:Parameters|Attributes)\n-+\n(.*?)(?=\n\n\S[^\n]*\n-+\n|\Z)", text or "", re.M | re.S
        ):
            for head, body in re.findall(r"^(\S[^\n]*)\n?((?:(?:[ ]+[^\n]*)?(?:\n|\Z))*)", section, re.M):
                names, _, sort = head.partition(" : ")
                for name in names.split(", "):
                    (found if sort else references).setdefault(name, (sort, inspect.cleandoc(body)))
    return references | found
