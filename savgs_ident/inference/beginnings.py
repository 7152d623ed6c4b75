"""The states with which tests begin that are compared from their beginning, and that do not begin at rest.

They are found by least squares, with the parameters of a model as they are or along with those that are to be
identified: how high a decay begins and how fast it dies away are of a kind, and where the parameters are off, so are
the beginnings. From there on they are unknowns of which nobody asks: what another beginning would change, to first
order, says nothing about a model (:class:`savgs_ident.inference.problem.HarmonicTarget`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array as JaxArray
from jaxtyping import Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.core.status import joint_status
from savgs_ident.core.values import Values, as_values
from savgs_ident.inference.problem import (
    HarmonicTarget,
    ProblemSettings,
    evaluate,
    harmonic_target,
    plan_task,
    whitened,
)
from savgs_ident.plants.base import AbstractPlant, state_sizes
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import Beginnings, HarmonicResponse
from savgs_ident.simulate.excitation import Measurements, measured_excitation
from savgs_ident.simulate.forgetting import forgetful_motion
from savgs_ident.simulate.periodic import PeriodicSolution, resolve, simulate_periodic, with_beginnings
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import changes_of_beginnings

Array = NDArray[np.float64]

EVALUATIONS = 80
"""Most motions that are solved for in a search."""

SETTLED = 1e-4
"""Share of the sum of squares by which a step has to lower it to be worth it."""

BEGIN = 0.5
"""The states with which the search begins, in their typical sizes."""

CORRECTIONS = 4
"""Most corrections of beginnings along a search that moves the parameters."""

WIDTH = 100.0
"""Standard deviation of a state beforehand, in its typical size: wide, and it keeps a state that nothing shows."""


def compared_motion(
    measured: Measurements,
    model: Model,
    orders: int,
    max_frequency: float | None = None,
    progress: Progress = no_progress,
) -> tuple[HarmonicResponse, PeriodicSolution | None]:
    """The response that a model is compared with, with estimated beginnings, and the model's motion in all tests.

    That is None where there are dwells alone, and where it is not known. Raises :class:`InputError` as
    :func:`savgs_ident.simulate.forgetting.forgetful_motion` does.
    """
    response, motion = forgetful_motion(measured, model, orders, max_frequency, progress)
    if response.part is None or not response.part.begins_moving.any():
        return response, motion
    return estimate_beginnings(response, model, orders, progress), None


def compared_response(
    measured: Measurements,
    model: Model,
    orders: int,
    max_frequency: float | None = None,
    progress: Progress = no_progress,
    identified: Model | None = None,
) -> HarmonicResponse:
    """The response alone, with the beginnings that go with an ``identified`` model where it is given."""
    response, _ = forgetful_motion(measured, model, orders, max_frequency, progress)
    if response.part is None or not response.part.begins_moving.any():
        return response
    return estimate_beginnings(response, identified or model, orders, progress)


def estimate_beginnings(
    response: HarmonicResponse, model: Model, orders: int, progress: Progress = no_progress
) -> HarmonicResponse:
    """The response with the states with which its tests begin, as a model has them.

    Raises :class:`InputError` where the model has no motion in such a test.
    """
    plant, p = model.build(), as_values(model.table.as_dict())
    begun = Begun.of_response(response, plant, orders)
    progress(f"estimating the states with which {begun.moving.size} tests begin")
    # Where a plant sticks at rest another beginning changes nothing: it begins in motion, first without its effects.
    nulls = {name: value for effect in plant.effects for name, value in effect.null.items()}
    bare = dict(p) | as_values(nulls)
    rest = simulate_periodic(plant, bare, measured_excitation(plant, response, model.table))
    solution = begun.beginning(rest, np.full(begun.moving.size * begun.sizes.size, BEGIN))
    for values in (bare, p) if nulls else (p,):
        solution = _begun_by(plant, values, begun, solution)
    lost = [response.tests[d] for d in begun.moving if not solution.status()[d].ok]
    if lost:
        raise InputError(
            f"the model has no motion in {', '.join(lost)}",
            remedy="mend its parameters, or leave these tests out",
        )
    return replace(response, beginnings=begun.known(plant, p, solution))


def _begun_by(
    plant: AbstractPlant, p: Values, begun: "Begun", solution: PeriodicSolution
) -> PeriodicSolution:
    """The motions of a plant with these parameters [SI] that begin as they miss least, from others."""

    def at(z: Array, near: PeriodicSolution) -> _Point:
        solution = resolve(plant, p, begun.beginning(near, z))

        def slopes() -> Array:
            return np.concatenate([begun.slopes(plant, p, solution), np.eye(z.size) / WIDTH])

        return _Point(solution, np.append(begun.missed(plant, p, solution), z / WIDTH), slopes)

    return _lowest(at, begun.of(solution), solution)[1]


class Settled(NamedTuple):
    """A response with the states with which its tests begin, and free coordinates ``u`` (n,) that go with them."""

    response: HarmonicResponse
    u: Float[JaxArray, " n"]


def settle_beginnings(
    response: HarmonicResponse,
    model: Model,
    free: tuple[str, ...],
    settings: ProblemSettings,
    progress: Progress = no_progress,
) -> Settled:
    """The states with which tests begin, estimated along with ``free`` parameters of a model.

    ``response`` has those that go with the model as given.
    """
    progress("estimating parameters and beginnings together")
    task = plan_task(response, model, free, settings)
    plant, count = task.problem.model, len(task.problem.free.names)
    begun = Begun.of_response(response, plant, settings.orders)
    problem = eqx.tree_at(lambda each: each.target, task.problem, begun.target)

    def at(z: Array, near: PeriodicSolution) -> _Point:
        u, states = jnp.asarray(z[:count]), z[count:]
        there = evaluate(problem, u, problem.unpinned, begun.beginning(near, states))
        missed = np.asarray(there.at.residual)[:-count]

        def slopes() -> Array:
            by_u = np.asarray(there.at.jacobian)[:-count]
            of_data = begun.slopes(plant, problem.parameters(u), there.solution)
            nothing = np.zeros((len(by_u) - len(of_data), states.size))
            by_states = np.concatenate([of_data, nothing, np.eye(states.size) / WIDTH])
            return np.concatenate([np.pad(by_u, [(0, states.size), (0, 0)]), by_states], axis=1)

        return _Point(there.solution, np.append(missed, states / WIDTH), slopes)

    u = np.asarray(problem.free.to_unconstrained(task.table.as_dict()))
    first = simulate_periodic(plant, problem.fixed, task.excitation, settings.periodic)
    z, solution = _lowest(at, np.concatenate([u, begun.of(first)]), first)
    there = jnp.asarray(z[:count])
    return Settled(
        replace(response, beginnings=begun.known(plant, problem.parameters(there), solution)), there
    )


@dataclass(frozen=True)
class Begun:
    """The states with which a plant begins in tests at the places ``moving`` (w,), and what is compared of it.

    As numbers that are searched they stand one after the other, each in its typical size, (w m,).

    Attributes:
        target: what is compared, in which beginnings count like anything else.
        moving: places of the tests, (w,).
        sizes: typical sizes of the plant's own states [SI], (m,).
    """

    target: HarmonicTarget
    moving: NDArray[np.intp]
    sizes: Array

    @classmethod
    def of_response(cls, response: HarmonicResponse, plant: AbstractPlant, orders: int) -> "Begun":
        """Those of a response with tests that begin moving; raises :class:`InputError` if nothing is compared."""
        assert response.part is not None
        target = harmonic_target(replace(response, beginnings=None), plant.channels, orders)
        count = 2 * len(plant.coordinates) + len(plant.own_states)
        return cls(target, np.flatnonzero(response.part.begins_moving), np.array(state_sizes(plant)[:count]))

    @property
    def orders(self) -> int:
        """The highest order that is compared."""
        return int(self.target.used.shape[-1]) - 1

    def of(self, solution: PeriodicSolution) -> Array:
        """Those of a motion."""
        first = solution.mesh.layout.starts[self.moving]
        return np.ravel(np.asarray(solution.trajectory.x)[: self.sizes.size, first].T / self.sizes)

    def beginning(self, solution: PeriodicSolution, z: Array) -> PeriodicSolution:
        """A motion that begins otherwise, not solved anew."""
        excitation = solution.excitation._replace(beginnings=jnp.asarray(self._states(z)))
        start = with_beginnings(solution.trajectory, excitation, solution.mesh.layout)
        return replace(solution, excitation=excitation, trajectory=start)

    def known(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> Beginnings:
        """Those of a motion, with what others would change."""
        return Beginnings(self._states(self.of(solution)), self._changes(model, p, solution))

    def missed(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> Array:
        """By how much a motion misses what is compared [sd]."""
        return np.asarray(self.target(harmonics(model, p, solution, self.orders)))

    def slopes(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> Array:
        """Slopes of that [sd], (., w m)."""
        by_test = whitened(np.asarray(self.target.whitening), self._changes(model, p, solution)) * self.sizes
        tests, each, count = by_test.shape
        found = np.zeros((tests, each, self.moving.size, count))
        found[self.moving, :, np.arange(self.moving.size)] = by_test[self.moving]
        return found.reshape(tests * each, -1)

    def best(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> PeriodicSolution:
        """The motion that begins as it misses least, from one nearby; that one where none is found."""
        missed = self.missed(model, p, solution)
        for _ in range(CORRECTIONS):
            slopes = self.slopes(model, p, solution)
            step = -np.linalg.lstsq(slopes, missed)[0]
            if np.sum((slopes @ step) ** 2) < SETTLED * np.sum(missed**2):
                break
            found = resolve(model, p, self.beginning(solution, self.of(solution) + step))
            there = self.missed(model, p, found)
            if not joint_status(found.status()).ok or not np.sum(there**2) < np.sum(missed**2):
                break
            solution, missed = found, there
        return solution

    def _states(self, z: Array) -> Array:
        """Numbers that are searched as states of all tests [SI], (D, m)."""
        found = np.zeros((self.target.used.shape[0], self.sizes.size))
        found[self.moving] = z.reshape(self.moving.size, -1) * self.sizes
        return found

    def _changes(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> NDArray[np.complex128]:
        return np.asarray(changes_of_beginnings(model, p, solution, self.orders, self.sizes.size))


class _Point(NamedTuple):
    """Motions somewhere in a search, the residuals there, and what their slopes are found with."""

    solution: PeriodicSolution
    residual: Array
    find_slopes: Callable[[], Array]


def _lowest(
    at: Callable[[Array, PeriodicSolution], _Point], z: Array, solution: PeriodicSolution
) -> tuple[Array, PeriodicSolution]:
    """Where the sum of squares is least, from ``z`` with the motions of a ``solution``, and the motions there."""
    # Campaigns that begin at rest do without.
    from scipy.optimize import least_squares

    last = at(z, solution)

    def residual(z: Array) -> Array:
        found = at(z, last.solution)
        ok = joint_status(found.solution.status()).ok and bool(np.isfinite(found.residual).all())
        tried[z.tobytes()] = found
        return found.residual if ok else np.full(found.residual.shape, np.inf)

    def slopes(z: Array) -> Array:
        nonlocal last
        last = tried[z.tobytes()]
        tried.clear()
        return last.find_slopes()

    tried = dict[bytes, _Point]()
    # Without a scale of its own the first step is of a typical size.
    found = least_squares(residual, z, slopes, ftol=SETTLED, xtol=None, gtol=None, max_nfev=EVALUATIONS)
    return found.x, last.solution
