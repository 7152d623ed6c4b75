"""What is compared with what: a model and its free parameters against a measured response.

A :class:`Task` is a model with all its parameters, a response and how to compare them; it makes a
:class:`Problem`, which a solver can evaluate. A target maps predicted harmonics (D, C, K) to residuals that are
independent with unit variance if the model is true; below them stand the deviations of the parameters from what is
known of them beforehand, in their standard deviations. The Jacobian is exact: sensitivities of the periodic solution
by the implicit function theorem, chained through target and coordinates.
"""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.errors import InputError
from savgs_ident.core.free_vector import FreeVector, known_to_tolerance
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.status import Status, joint_status
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import InputSignal
from savgs_ident.inference.targets import Target, harmonic_target, peak_to_peak_target
from savgs_ident.plants.base import AbstractPlant, Excitation, Motion
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.periodic import PeriodicSettings, PeriodicSolution, resolve
from savgs_ident.simulate.program_cache import compiled_quickly, placed
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import harmonics_with_sensitivities


class Pins(NamedTuple):
    """Free coordinates [1] held near a value.

    Residuals ``weight`` (u - ``at``), both (n,); weight 0 leaves one free.
    """

    weight: Float[Array, " n"]
    at: Float[Array, " n"]


class Problem(eqx.Module):
    """Model, free vector, values of everything else [SI], and what is compared up to which order."""

    model: AbstractPlant
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


def used_parameters(model: AbstractPlant, table: ParameterTable) -> frozenset[str]:
    """The parameters in ``table`` that a response of ``model`` can depend on."""
    size = len(model.states)

    def response(p: Values) -> tuple[Array, ...]:
        zero = jnp.zeros(())
        pair = model.coordinate_type(*(zero for _ in model.coordinates))
        inputs = model.drive(tuple(InputSignal(zero, zero) for _ in model.inputs))
        state = jnp.zeros(size)
        residual = model.residual(p, Motion(pair, pair, pair), state, state, inputs)
        seen = model.read(p, Motion(pair, pair, pair), state, state, inputs)
        return residual, *seen, model.transfers(p, zero)

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

    @property
    def status(self) -> Status:
        """How the search for the motions ended, and whether residuals and Jacobian of those found are numbers."""
        motions = joint_status(self.solution.status())
        if not motions.ok:
            return motions
        return Status.CONVERGED if self.finite else Status.NOT_FINITE

    @property
    def finite(self) -> bool:
        """Whether residuals and Jacobian are numbers: enough to step on from, not to end at."""
        return bool(np.isfinite(self.at.residual).all() and np.isfinite(self.at.jacobian).all())


def evaluate(problem: Problem, u: Float[Array, " n"], pins: Pins, warm_start: PeriodicSolution) -> Evaluation:
    """Residuals of data, priors and pins at free coordinates ``u``, solved from ``warm_start`` on its nodes.

    The solver is the one that made ``warm_start``, compiled already.
    """
    u, pins = placed((u, pins))
    p = problem.parameters(u)
    return _evaluation(problem, pins, u, p, resolve(problem.model, p, warm_start, problem.iterations))


def evaluate_beside(problem: Problem, u: Float[Array, " n"], pins: Pins, best: Evaluation) -> Evaluation:
    """The same, started from a ``best`` point known so far; whose Jacobian it borrows if it is no better.

    Such a point is rejected by any optimiser, and its own Jacobian would cost most of the evaluation. ``u`` are
    free coordinates.
    """
    u, pins = placed((u, pins))
    p = problem.parameters(u)
    solution = resolve(problem.model, p, best.solution, problem.iterations)
    predicted = harmonics(problem.model, p, solution, problem.orders)
    residual = _residual(problem.free, problem.target, pins, u, predicted)
    if np.sum(np.asarray(residual) ** 2) < np.sum(np.asarray(best.at.residual) ** 2):
        return _evaluation(problem, pins, u, p, solution)
    return Evaluation(Linearised(u, residual, best.at.jacobian), solution)


def _evaluation(problem: Problem, pins: Pins, u: Array, p: Values, solution: PeriodicSolution) -> Evaluation:
    names, orders = problem.free.names, problem.orders
    predicted, by_name = harmonics_with_sensitivities(problem.model, p, solution, names, orders)
    residual, jacobian = _residual_and_jacobian(problem.free, problem.target, pins, u, predicted, by_name)
    return Evaluation(Linearised(u, residual, jacobian), solution)


@compiled_quickly
def _residual_and_jacobian(
    free: FreeVector, target: Target, pins: Pins, u: Array, predicted: Array, by_name: Array
) -> tuple[Array, Array]:
    columns = jax.vmap(lambda change: jax.jvp(target, (predicted,), (change,))[1])(by_name)
    priors = jax.jacfwd(free.prior_residuals)(u)
    jacobian = jnp.concatenate([columns.T * free.jacobian_diag(u), priors, jnp.diag(pins.weight)])
    return _residual(free, target, pins, u, predicted), jacobian


@eqx.filter_jit
def _residual(free: FreeVector, target: Target, pins: Pins, u: Array, predicted: Array) -> Array:
    return jnp.concatenate([target(predicted), free.prior_residuals(u), pins.weight * (u - pins.at)])


Quantity = Literal["harmonics", "peak_to_peak"]


@dataclass(frozen=True)
class ProblemSettings:
    """What is compared with what.

    Attributes:
        orders: highest harmonic order that is compared.
        fixed_tolerances: take the parameters with a tolerance as exact instead of estimating them along.
        quantity: compare complex harmonics, or peak-to-peak values only, as the paper did.
        periodic: how finely to solve the model.
    """

    orders: int = 9
    fixed_tolerances: bool = False
    quantity: Quantity = "harmonics"
    periodic: PeriodicSettings = field(default_factory=PeriodicSettings)


class Task(NamedTuple):
    """A model, all its parameters, a response and how to compare them; the problem that follows."""

    model: Model
    table: ParameterTable
    measured: HarmonicResponse
    settings: ProblemSettings
    excitation: Excitation
    problem: Problem


def plan_task(
    measured: HarmonicResponse, model: Model, free: tuple[str, ...], settings: ProblemSettings
) -> Task:
    """The task of identifying ``free`` parameters of a model.

    Raises :class:`InputError` for names that do not exist or that the model does not use, and for a response
    that cannot be used.
    """
    table, plant = model.table, model.build()
    used = used_parameters(plant, table)
    check_free(free, table, used)
    tolerated = tuple(name for name in known_to_tolerance(table, free) if name in used)
    free_vector = FreeVector(table, free, () if settings.fixed_tolerances else tolerated)
    target: Target
    if settings.quantity == "harmonics":
        target = harmonic_target(measured, plant.channels, settings.orders)
    else:
        target = peak_to_peak_target(measured, plant.channels)
    orders, iterations = target.used.shape[-1] - 1, settings.periodic.iterations
    problem = Problem(plant, free_vector, as_values(table.as_dict()), target, orders, iterations)
    excitation = measured_excitation(plant, measured, table)
    return Task(model, table, measured, settings, excitation, problem)


def check_free(free: tuple[str, ...], table: ParameterTable, used: frozenset[str]) -> None:
    """Raises :class:`InputError` for parameters to identify that do not exist or are not ``used``."""
    remedy = "choose among: " + ", ".join(sorted(used))
    for name in free:
        if name not in table:
            raise InputError(f"there is no parameter '{name}'", remedy=remedy)
        if name not in used:
            raise InputError(f"the model does not depend on '{name}'", remedy=remedy)
