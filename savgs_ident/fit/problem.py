"""A fit as a least-squares problem on unconstrained coordinates.

The residuals are those of the data in standard deviations, followed by the deviations of the tolerance
parameters in theirs (their priors). The Jacobian is exact: sensitivities of the periodic solution by the
implicit function theorem, chained through target and coordinates.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.fit.target import Target
from savgs_ident.model.dynamics import Coordinates, Motion
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.strut import Link
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values, as_values
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import PeriodicSolution, resolve
from savgs_ident.simulate.sensitivity import harmonic_sensitivities
from savgs_ident.simulate.stored import placed, stored


class Pins(NamedTuple):
    """Free coordinates [1] held near a value.

    Residuals ``weight`` (u - ``at``), both (n,); weight 0 leaves one free.
    """

    weight: Float[Array, " n"]
    at: Float[Array, " n"]


class Problem(eqx.Module):
    """Model, free vector, values of everything else [SI], and what is compared up to which order."""

    model: QuarterCar
    free: FreeVector
    fixed: dict[str, Float[Array, ""]]
    target: Target
    orders: int = eqx.field(static=True)
    iterations: int = eqx.field(static=True)

    def parameters(self, u: Float[Array, " n"]) -> Values:
        """All parameters of the model [SI] at unconstrained coordinates."""
        return self.fixed | _to_constrained(self.free, u)

    def slopes(self, u: Float[Array, " n"]) -> Float[Array, " n"]:
        """d(parameter)/du of every free parameter [its SI unit]."""
        return _slopes(self.free, u)

    @property
    def unpinned(self) -> Pins:
        """No coordinate held."""
        nothing = jnp.zeros(len(self.free.names))
        return Pins(nothing, nothing)


def used_parameters(model: QuarterCar, table: ParameterTable) -> frozenset[str]:
    """The parameters in ``table`` that a response of ``model`` can depend on."""
    size = len(model.states)

    def response(p: Values) -> tuple[Array, ...]:
        zero = jnp.zeros(())
        pair = Coordinates(zero, zero)
        inputs = Inputs(Road(zero, zero), Link(zero, zero))
        state = jnp.zeros(size)
        residual = model.residual(p, Motion(pair, pair, pair), state, state, inputs)
        return residual, *model.read(p, zero, zero), model.transfers(p, zero)

    values = as_values(table.as_dict())
    jaxpr = jax.make_jaxpr(response)(values).jaxpr
    needed = {id(variable) for variable in jaxpr.outvars}
    for equation in reversed(jaxpr.eqns):
        if any(id(variable) in needed for variable in equation.outvars):
            needed |= {id(variable) for variable in equation.invars}
    # A dictionary is flattened in the order of its sorted keys.
    return frozenset(n for n, v in zip(sorted(values), jaxpr.invars, strict=True) if id(v) in needed)


# Compiled as a whole: the maps of forty parameters, one operation at a time, would take seconds.
@eqx.filter_jit
def _to_constrained(free: FreeVector, u: Array) -> dict[str, Array]:
    return free.to_constrained(u)


@eqx.filter_jit
def _slopes(free: FreeVector, u: Array) -> Array:
    return free.jacobian_diag(u)


class Linearised(NamedTuple):
    """A problem about the free coordinates ``u`` (n,): residuals (m,) there and their Jacobian (m, n)."""

    u: Float[Array, " n"]
    residual: Float[Array, " m"]
    jacobian: Float[Array, "m n"]


class Evaluation(NamedTuple):
    """A problem evaluated at a point, and the model's periodic motions there."""

    at: Linearised
    solution: PeriodicSolution


def evaluate(problem: Problem, u: Float[Array, " n"], pins: Pins, near: PeriodicSolution) -> Evaluation:
    """Residuals of data, priors and pins at free coordinates ``u``, on the nodes of ``near`` and started from it.

    The solver is the one that made ``near``, compiled already.
    """
    u, pins = placed((u, pins))
    p = problem.parameters(u)
    return _evaluation(problem, pins, u, p, resolve(problem.model, p, near, problem.iterations))


def evaluate_beside(problem: Problem, u: Float[Array, " n"], pins: Pins, best: Evaluation) -> Evaluation:
    """The same, started from a ``best`` point known so far; whose Jacobian it borrows if it is no better.

    Such a point is rejected by any optimiser, and its own Jacobian would cost most of the evaluation. ``u`` are
    free coordinates.
    """
    u, pins = placed((u, pins))
    p = problem.parameters(u)
    solution = resolve(problem.model, p, best.solution, problem.iterations)
    residual = _residual_at(problem, pins, u, p, solution)
    if jnp.sum(residual**2) < jnp.sum(best.at.residual**2):
        return _evaluation(problem, pins, u, p, solution)
    return Evaluation(Linearised(u, residual, best.at.jacobian), solution)


def _evaluation(problem: Problem, pins: Pins, u: Array, p: Values, solution: PeriodicSolution) -> Evaluation:
    residual, jacobian = _compared(problem, pins, u, p, solution)
    return Evaluation(Linearised(u, residual, jacobian), solution)


@eqx.filter_jit
def _compared(*args: Any) -> tuple[Array, ...]:
    return stored(_residual_and_jacobian, *args)


def _residual_and_jacobian(
    problem: Problem, pins: Pins, u: Array, p: Values, solution: PeriodicSolution
) -> tuple[Array, Array]:
    predicted = harmonics(problem.model, p, solution, problem.orders)
    by_name = harmonic_sensitivities(problem.model, p, solution, problem.free.names, problem.orders)
    columns = jax.vmap(lambda change: jax.jvp(problem.target, (predicted,), (change,))[1])(by_name)
    priors = jax.jacfwd(problem.free.prior_residuals)(u)
    jacobian = jnp.concatenate([columns.T * problem.slopes(u), priors, jnp.diag(pins.weight)])
    return _residual_at(problem, pins, u, p, solution), jacobian


@eqx.filter_jit
def _residual_at(problem: Problem, pins: Pins, u: Array, p: Values, solution: PeriodicSolution) -> Array:
    data = problem.target(harmonics(problem.model, p, solution, problem.orders))
    return jnp.concatenate([data, problem.free.prior_residuals(u), pins.weight * (u - pins.at)])
