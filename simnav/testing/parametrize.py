"""Decorators that make tests of estimators: one for each check of the contract, one for each row of a comparison."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from simnav.testing.contract_check import CHECKS, Candidate, Check
from simnav.testing.estimator_forms import EstimatorLike, Factory, factories, listed

if TYPE_CHECKING:
    import pytest

__all__ = ["parametrize_with_checks", "parametrize_with_rows"]

#: The rows that are timed together with an estimator by default.
ROWS = ("gnss-only", "ekf", "sw-fgo")


class EstimatorUnderTest:
    """The estimator of a test. It is constructed at the first check, so that the collection of tests is quick.

    Attributes
    ----------
    label : str
        Name and parameters, as in the id of the test.
    """

    def __init__(self, label: str, factory: Factory):
        self.label = label
        self._factory = factory

    def __repr__(self) -> str:
        return self.label

    @cached_property
    def candidate(self) -> Candidate:
        """The estimator in the form of the contract test; all checks share its first run."""
        return Candidate(self._factory)


class AssertedCheck:
    """A check of the contract that raises an AssertionError if it fails.

    Attributes
    ----------
    check : simnav.testing.contract_check.Check
        The check with its name and sentence.
    """

    def __init__(self, check: Check):
        self.check = check

    def __repr__(self) -> str:
        return repr(self.check.name)

    def __call__(self, estimator: EstimatorUnderTest) -> None:
        """Run the check.

        Raises
        ------
        AssertionError
            If the estimator does not meet the requirement; the message says where.
        EstimatorError
            If there is no such estimator, or it cannot be constructed.
        """
        __tracebackhide__ = True
        left_out = self.check.left_out(estimator.candidate)
        if left_out:
            import pytest

            pytest.skip(left_out)
        finding = self.check(estimator.candidate)
        if not finding.ok:
            raise AssertionError(
                f"{estimator.label} fails the check {finding.name!r}: {finding.sentence}. "
                f"What is demanded: {self.check.sentence}"
            )


def parametrize_with_checks(
    estimators: EstimatorLike | Iterable[EstimatorLike], *, expected_failures: Mapping[str, str] | None = None
) -> pytest.MarkDecorator:
    """Make one test of each check of the contract and each estimator.

    The id of a test is the label of the estimator and the name of the check: ``MyFilter-causality``. The checks are
    those of ``simnav check``. If the check ``output`` fails, checks that would only repeat this failure are skipped;
    if ``determinism`` fails, ``reset`` and ``causality`` are skipped.

    Parameters
    ----------
    estimators : estimator or iterable of them
        A class of `simnav.Estimator`, a function that makes one, a registered name, a file (``my.py``,
        ``my.py:MyFilter``), or a pair of one of these and a mapping of parameters.
    expected_failures : mapping of str to str, optional
        The reason why a check is expected to fail, by the name of the check. These tests are marked ``xfail``.

    Returns
    -------
    pytest.MarkDecorator
        Decorator for a function with the arguments ``estimator`` and ``check``.

    Raises
    ------
    TypeError
        If one of them is not an estimator.
    ValueError
        If there is no check with a name in ``expected_failures``.

    Examples
    --------
    >>> from simnav.testing import parametrize_with_checks
    >>> @parametrize_with_checks(["gnss-only", ("ekf", {"calibrate": False})])
    ... def test_contract(estimator, check):
    ...     check(estimator)
    """
    import pytest

    expected = dict(expected_failures or {})
    names = [check.name for check in CHECKS]
    unknown = [name for name in expected if name not in names]
    if unknown:
        raise ValueError(f"expected_failures: there is no check {unknown[0]!r}; there are {', '.join(names)}")
    cases = []
    for label, factory in factories(estimators).items():
        estimator = EstimatorUnderTest(label, factory)
        for check in CHECKS:
            marks = [pytest.mark.xfail(reason=expected[check.name])] if check.name in expected else []
            name = check.name.replace(" ", "-")
            cases.append(pytest.param(estimator, AssertedCheck(check), id=f"{label}-{name}", marks=marks))
    return pytest.mark.parametrize(("estimator", "check"), cases)


def parametrize_with_rows(
    estimators: EstimatorLike | Iterable[EstimatorLike],
    *,
    beside: EstimatorLike | Sequence[EstimatorLike] = ROWS,
    group: str = "an epoch",
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make one benchmark of each estimator and of the rows beside it, all in one group of pytest-benchmark.

    Parameters
    ----------
    estimators : estimator or iterable of them
        Estimators in any form, as for `parametrize_with_checks`.
    beside : estimator or sequence of them
        Rows that are timed for comparison.
    group : str
        Name of the group; pytest-benchmark prints one table for each group.

    Returns
    -------
    callable
        Decorator for a function with the argument ``make_estimator``, a function that returns a new instance. The
        fixture ``benchmark_epochs`` of `simnav.testing.fixtures` times it.

    Raises
    ------
    TypeError
        If one of them is not an estimator.

    Examples
    --------
    >>> from simnav.testing import parametrize_with_rows
    >>> @parametrize_with_rows("gnss-only", beside=["ekf"])
    ... def test_cost(benchmark_epochs, make_estimator):
    ...     benchmark_epochs(make_estimator)
    """
    import pytest

    rows = factories([*listed(estimators), *listed(beside)])
    cases = [pytest.param(factory, id=label) for label, factory in rows.items()]

    def decorate(function: Callable[..., None]) -> Callable[..., None]:
        marked: Callable[..., None] = pytest.mark.parametrize("make_estimator", cases)(function)
        marked = pytest.mark.benchmark(group=group)(marked)
        return marked

    return decorate
