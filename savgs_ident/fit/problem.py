"""A fit as a least-squares problem on unconstrained coordinates.

The residuals are those of the data in standard deviations, followed by the deviations of the tolerance
parameters in theirs (their priors). The Jacobian is exact: sensitivities of the periodic solution by the
implicit function theorem, chained through target and coordinates. It is formed once per evaluation and given
to JAX as the derivative of the residuals, so that any optimiser may ask for it.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.free_vector import FreeVector, known_to_tolerance
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.fit.target import Target
from savgs_ident.model.dynamics import Coordinates, Motion
from savgs_ident.model.quarter_car import Inputs, QuarterCar
from savgs_ident.model.sensors import read_sensors
from savgs_ident.model.strut import Link
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values, as_values
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.periodic import (
    PeriodicSolution,
    harmonic_sensitivities,
    harmonics,
    solve_on_mesh,
)


class Pins(NamedTuple):
    """Coordinates held near a value: residuals ``weight`` (u - ``at``), both (n,); weight 0 leaves one free."""

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
        return residual, *read_sensors(p, zero, zero)

    values = as_values(table.as_dict())
    jaxpr = jax.make_jaxpr(response)(values).jaxpr
    read = {id(variable) for equation in jaxpr.eqns for variable in equation.invars}
    # A dictionary is flattened in the order of its sorted keys.
    return frozenset(n for n, v in zip(sorted(values), jaxpr.invars, strict=True) if id(v) in read)


def tolerated_parameters(model: QuarterCar, table: ParameterTable, free: tuple[str, ...]) -> tuple[str, ...]:
    """Parameters known to a tolerance that the response depends on and that are not free."""
    used = used_parameters(model, table)
    return tuple(name for name in known_to_tolerance(table, free) if name in used)


# Compiled as a whole: the maps of forty parameters, one operation at a time, would take seconds.
@eqx.filter_jit
def _to_constrained(free: FreeVector, u: Array) -> dict[str, Array]:
    return free.to_constrained(u)


@eqx.filter_jit
def _slopes(free: FreeVector, u: Array) -> Array:
    return free.jacobian_diag(u)


class Found(NamedTuple):
    """The moving parts of a periodic solution: see :class:`PeriodicSolution`."""

    trajectory: Trajectory
    last_step: Float[Array, " D"]

    def put_into(self, solution: PeriodicSolution) -> PeriodicSolution:
        """``solution`` with these parts; its linearisation is left as it was."""
        return eqx.tree_at(lambda each: (each.trajectory, each.last_step), solution, tuple(self))


@eqx.filter_custom_jvp
def residuals(
    u: Float[Array, " n"], *, problem: Problem, pins: Pins, near: PeriodicSolution
) -> tuple[Float[Array, " m"], Found]:
    """Residuals of data, priors and pins at ``u``; what was found there, on the nodes of ``near``."""
    p = problem.parameters(u)
    solution = _solve(problem, p, near)
    return _residuals_at(problem, pins, u, harmonics(p, solution, problem.orders)), _found(solution)


@residuals.def_jvp
def _residuals_jvp(
    primals: tuple[Array], tangents: tuple[Array], *, problem: Problem, pins: Pins, near: PeriodicSolution
) -> tuple[tuple[Array, Found], tuple[Array, Found]]:
    (u,), (direction,) = primals, tangents
    p = problem.parameters(u)
    solution = _solve(problem, p, near)
    predicted = harmonics(p, solution, problem.orders)
    by_name = harmonic_sensitivities(problem.model, p, solution, problem.free.names, problem.orders)
    columns = jax.vmap(lambda change: jax.jvp(problem.target, (predicted,), (change,))[1])(by_name)
    data = columns.T * problem.slopes(u)
    priors = jax.jacfwd(problem.free.prior_residuals)(u)
    jacobian = jnp.concatenate([data, priors, jnp.diag(pins.weight)])
    found = _found(solution)
    still = jax.tree.map(jnp.zeros_like, found)
    return (_residuals_at(problem, pins, u, predicted), found), (jacobian @ direction, still)


def _found(solution: PeriodicSolution) -> Found:
    return Found(solution.trajectory, solution.last_step)


def _solve(problem: Problem, p: Values, near: PeriodicSolution) -> PeriodicSolution:
    return solve_on_mesh(problem.model, p, near.excitation, near.mesh, near.trajectory, problem.iterations)


def _residuals_at(problem: Problem, pins: Pins, u: Array, predicted: Array) -> Array:
    held = pins.weight * (u - pins.at)
    return jnp.concatenate([problem.target(predicted), problem.free.prior_residuals(u), held])
