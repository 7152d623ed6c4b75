"""The next test: the one that would best distinguish two hypotheses that this campaign hardly distinguishes.

Both are taken as fitted to this campaign and predict further ones, under each of the conditions that the plant
declares: a larger input, another mean of one, more payload. The difference that the other one could not make up by
moving its parameters as far as this campaign allows, in units of the noise, is the significance to expect.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.threads import in_parallel
from savgs_ident.diagnosis.findings import hypothesis_of
from savgs_ident.diagnosis.result import NextTest
from savgs_ident.effects.base import AbstractInputLaw
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.observations import Prediction
from savgs_ident.inference.prior import slopes_at
from savgs_ident.plants.base import Excitation, OperatingCondition
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.periodic import PeriodicSolution

if TYPE_CHECKING:
    from savgs_ident.diagnosis.dwell_problem import DwellProblem


def next_tests(
    search: Search, problem: "DwellProblem", one: LaplaceFit, other: LaplaceFit
) -> tuple[NextTest, ...]:
    """The tests that separate two hypotheses best, most significant first."""
    pair = hypothesis_of(one), hypothesis_of(other)
    drafts = sorted(_drafts(search, problem, one, other), key=lambda each: -each.raw)
    found = []
    for draft in drafts[: problem.constants.proposed_tests]:
        hertz = ", ".join(f"{f:.3g}" for f in np.sort(np.asarray(problem.excitation.frequency)[draft.tests]))
        text = f"dwells at {hertz} Hz, {draft.condition.text}"
        found.append(NextTest(text, pair, _expected(search, problem, other, draft)))
    return tuple(sorted(found, key=lambda each: -each.expected_sigma))


class _Draft(NamedTuple):
    """A test under a condition: its most significant dwells, what the hypotheses differ by, motions of the second.

    ``raw`` is the significance before the second hypothesis has moved its parameters.
    """

    condition: OperatingCondition
    tests: NDArray[np.intp]
    miss: NDArray[np.float64]
    raw: float
    warm_start: Any


def _drafts(search: Search, problem: "DwellProblem", one: LaplaceFit, other: LaplaceFit) -> list[_Draft]:
    """A draft for every condition under which both hypotheses can be solved."""

    def draft(condition: OperatingCondition) -> _Draft | None:
        found, second = (predicted(problem, mode, condition) for mode in (one, other))
        if not (found.solved and second.solved):
            return None
        miss = found.rows - second.rows
        by_test = np.bincount(search.data.test, miss**2 / search.data.variance)
        tests = np.argsort(by_test)[::-1][: problem.constants.proposed_dwells]
        return _Draft(condition, tests, miss, float(np.sqrt(by_test[tests].sum())), second.warm_start)

    return [each for each in in_parallel(draft, problem.plant.conditions) if each is not None]


def predicted(
    problem: "DwellProblem",
    mode: LaplaceFit,
    condition: OperatingCondition,
    names: Sequence[str] = (),
    near: PeriodicSolution | None = None,
) -> Prediction:
    """A hypothesis under a condition, with slopes in the named parameters, from motions ``near`` it if known."""
    near = _begin(mode, condition) if near is None else near
    there = _driven(problem, condition)
    moved = eqx.tree_at(lambda each: each.excitation, near, there)
    values = _changed(mode.values, problem, condition.changes)
    if condition.scale == 0.0:
        values |= _of_an_input_at_rest(mode.terms, problem)
    return replace(problem, excitation=there, corrections={}).predict(mode.terms, values, names, moved)


def _driven(problem: "DwellProblem", condition: OperatingCondition) -> Excitation:
    """The inputs of the campaign under a condition."""
    harmonics = dict(problem.excitation.harmonics)
    first = problem.plant.inputs[0].name
    harmonics[first] = condition.scale * harmonics[first]
    # An input that was not recorded has no first order, and JAX leaves out what would be added to it.
    for order, changes in enumerate((condition.offsets, condition.swings)):
        for name, change in changes.items():
            harmonics[name] = jnp.asarray(harmonics[name]).at[:, order].add(change)
    return problem.excitation._replace(harmonics=harmonics)


def _begin(mode: LaplaceFit, condition: OperatingCondition) -> PeriodicSolution:
    """Where to look for the motion of a hypothesis from: its own, or rest."""
    near: PeriodicSolution = mode.prediction.warm_start
    if condition.scale > 0.0:
        return near
    rest = Trajectory(*(jnp.zeros_like(part) for part in near.trajectory))
    return eqx.tree_at(lambda each: each.trajectory, near, rest)


def _of_an_input_at_rest(terms: Sequence[str], problem: "DwellProblem") -> dict[str, float]:
    """Null values of what the terms do to the inputs: a cam at rest has no shape; a plate still gives way."""
    effects = [problem.catalogue[name] for name in terms]
    moving = [each for each in effects if isinstance(each.law, AbstractInputLaw)]
    return {name: null for each in moving for name, null in each.null.items()}


def _expected(search: Search, problem: "DwellProblem", other: LaplaceFit, draft: _Draft) -> float:
    """Significance of a draft once the second hypothesis has moved its parameters as far as the campaign allows."""
    names = [each.name for each in other.coordinates]
    second = predicted(problem, other, draft.condition, names, draft.warm_start)
    chosen = np.isin(search.data.test, draft.tests)
    slopes = (second.slopes * slopes_at(other.coordinates, other.x))[chosen]
    spread = np.diag(search.data.variance[chosen]) + slopes @ other.covariance() @ slopes.T
    miss = draft.miss[chosen]
    return float(np.sqrt(miss @ np.linalg.solve(spread, miss)))


def _changed(
    values: Mapping[str, float], problem: "DwellProblem", changes: Mapping[str, float]
) -> dict[str, float]:
    known = problem.parameters.as_dict() | dict(values)
    return dict(values) | {name: known[name] + change for name, change in changes.items()}
