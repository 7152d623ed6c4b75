"""The states with which tests begin that are compared from their beginning, and that do not begin at rest.

They are found by least squares, with the parameters of a model as they are or along with those that are to be
identified: how high a decay begins and how fast it dies away are of a kind, and where the parameters are off, so are
the initial states. From there on they are nuisances: what others would change, to first order, says nothing about a
model (:class:`savgs_ident.inference.targets.HarmonicTarget`).

States that slide, as the anchor of a contact that sticks, begin where nothing stretches them: the first slip makes
them forget it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array as JaxArray
from jaxtyping import Float
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.core.values import Values, as_values
from savgs_ident.inference.problem import ProblemSettings, evaluate, plan_task
from savgs_ident.inference.targets import HarmonicTarget, harmonic_target, whitened
from savgs_ident.plants.base import AbstractPlant, state_sizes
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse, InitialStates
from savgs_ident.simulate.compared_tests import Measurements
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.forgetting import forgetful_motion
from savgs_ident.simulate.periodic import PeriodicSolution, resolve, simulate_periodic, with_initial_states
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import changes_by_initial_states

Array = NDArray[np.float64]

EVALUATIONS = 80
"""Most motions that are solved for in a search."""

SETTLED = 1e-4
"""Share of the sum of squares by which a step has to lower it to be worth it."""

LEAST_STEP = 1e-6
"""Steps of a search that are shorter than this share of where it is lead nowhere: it has ended."""

BEGIN = 0.5
"""The states with which the search begins, in their typical sizes."""

CORRECTIONS = 4
"""Most corrections of initial states along a search that moves the parameters."""

WIDTH = 100.0
"""Standard deviation of a state beforehand, in its typical size: wide, and it keeps a state that nothing shows."""


def compared_motion(
    measured: Measurements,
    model: Model,
    orders: int,
    max_frequency: float | None = None,
    progress: Progress = no_progress,
    identified: Model | None = None,
) -> tuple[HarmonicResponse, PeriodicSolution | None]:
    """The response that a model is compared with, and the model's motion in all tests where that is known.

    Its initial states are those that go with the model, or with one that is ``identified`` where that is given.
    Raises :class:`InputError` as :func:`savgs_ident.simulate.forgetting.forgetful_motion` does.
    """
    response, motion = forgetful_motion(measured, model, orders, max_frequency, progress)
    if response.part is None or not response.part.begins_moving.any():
        return response, motion
    return estimate_initial_states(response, identified or model, orders, progress), None


def estimate_initial_states(
    response: HarmonicResponse, model: Model, orders: int, progress: Progress = no_progress
) -> HarmonicResponse:
    """The response with the initial states of its tests that do not begin at rest, as a model has them.

    With a warning ``initial_state_not_found`` where the search for them did not end. Raises :class:`InputError` where
    the model has no motion in such a test.
    """
    plant, p = model.build(), as_values(model.table.as_dict())
    free = FreeInitialStates.of_response(response, plant, orders)
    progress(f"estimating the initial states of {free.moving.size} tests")
    # Where a plant sticks at rest another state changes nothing: it begins in motion, first without its effects.
    nulls = {name: value for effect in plant.effects for name, value in effect.null.items()}
    bare = dict(p) | as_values(nulls)
    rest = simulate_periodic(plant, bare, measured_excitation(plant, response, model.table))
    solution = free.beginning(plant, rest, np.full(free.of(plant, rest).size, BEGIN))
    ended = True
    for values in (bare, p) if nulls else (p,):
        solution, ended = _estimated(plant, values, free, solution)
    lost = [response.tests[d] for d in free.moving if not solution.status()[d].ok]
    if lost:
        raise InputError(
            f"the model has no motion in {', '.join(lost)}",
            remedy="mend its parameters, or leave these tests out",
        )
    return _with_known(response, free.known(plant, p, solution), ended)


def _with_known(response: HarmonicResponse, known: InitialStates, ended: bool) -> HarmonicResponse:
    code = "initial_state_not_found"
    warnings = tuple(each for each in response.warnings if each.code != code)
    if not ended:
        warning = DataWarning(
            code,
            "the search for the states with which tests begin did not end",
            remedy="begin with better parameters, or let tests begin at rest",
        )
        warnings = (*warnings, warning)
    return replace(response, initial_states=known, warnings=warnings)


def _estimated(
    plant: AbstractPlant, p: Values, free: "FreeInitialStates", solution: PeriodicSolution
) -> tuple[PeriodicSolution, bool]:
    """The motions of a plant that miss least, from others, and whether the search ended; ``p`` is in SI."""

    def at(z: Array, near: PeriodicSolution) -> _Point:
        found = resolve(plant, p, free.beginning(plant, near, z))

        def slopes() -> Array:
            return np.concatenate([free.slopes(plant, p, found), np.eye(z.size) / WIDTH])

        missed = np.append(free.missed(plant, p, found), z / WIDTH)
        return _Point(found, free.solved(found), missed, slopes)

    _, point, ended = _lowest(at, free.of(plant, solution), solution)
    return point.solution, ended


class Settled(NamedTuple):
    """A response with the initial states of its tests, and free coordinates ``u`` (n,) that go with them.

    Those are None where nothing was found.
    """

    response: HarmonicResponse
    u: Float[JaxArray, " n"] | None


def settle_initial_states(
    response: HarmonicResponse,
    model: Model,
    free: tuple[str, ...],
    settings: ProblemSettings,
    progress: Progress = no_progress,
    values: Mapping[str, float] = MappingProxyType({}),
) -> Settled:
    """The initial states of tests, estimated along with ``free`` parameters of a model, from ``values`` [SI].

    ``response`` has those that go with the model as given, which stay where the model lacks a motion in any test.
    """
    progress("estimating parameters and initial states together")
    task = plan_task(response, model, free, settings)
    plant, count = task.problem.model, len(task.problem.free.names)
    states = FreeInitialStates.of_response(response, plant, settings.orders)
    problem = eqx.tree_at(lambda each: each.target, task.problem, states.target)

    def at(z: Array, near: PeriodicSolution) -> _Point:
        u, begin = jnp.asarray(z[:count]), z[count:]
        there = evaluate(problem, u, problem.unpinned, states.beginning(plant, near, begin))
        missed = np.asarray(there.at.residual)[:-count]

        def slopes() -> Array:
            by_u = np.asarray(there.at.jacobian)[:-count]
            of_data = states.slopes_of_all(plant, problem.parameters(u), there.solution)
            nothing = np.zeros((len(by_u) - len(of_data), begin.size))
            by_states = np.concatenate([of_data, nothing, np.eye(begin.size) / WIDTH])
            return np.concatenate([np.pad(by_u, [(0, begin.size), (0, 0)]), by_states], axis=1)

        return _Point(there.solution, there.status.ok, np.append(missed, begin / WIDTH), slopes)

    u = np.asarray(problem.free.to_unconstrained(dict(task.table.as_dict()) | dict(values)))
    p = problem.parameters(jnp.asarray(u))
    first = simulate_periodic(plant, p, task.excitation, settings.periodic)
    z, point, ended = _lowest(at, np.concatenate([u, states.of(plant, first)]), first)
    if not point.solved:
        return Settled(response, None)
    there = jnp.asarray(z[:count])
    known = states.known(plant, problem.parameters(there), point.solution)
    return Settled(_with_known(response, known, ended), there)


@dataclass(frozen=True)
class FreeInitialStates:
    """The initial states of a plant in tests at the places ``moving`` (w,), and what is compared of it.

    As numbers that are searched they stand one after the other, each in its typical size, (w m,).

    Attributes:
        target: what is compared, in which initial states count like anything else, and offsets of sensors do not.
        moving: places of the tests, (w,).
    """

    target: HarmonicTarget
    moving: NDArray[np.intp]

    @classmethod
    def of_response(
        cls, response: HarmonicResponse, plant: AbstractPlant, orders: int
    ) -> "FreeInitialStates":
        """Those of a response with tests that begin moving; raises :class:`InputError` if nothing is compared."""
        assert response.part is not None
        target = harmonic_target(replace(response, initial_states=None), plant.channels, orders)
        return cls(target, np.flatnonzero(response.part.begins_moving))

    def seeing(self, measured: NDArray[np.complex128]) -> "FreeInitialStates":
        """The same for other measured harmonics (D, C, K)."""
        return replace(
            self, target=eqx.tree_at(lambda each: each.measured, self.target, jnp.asarray(measured))
        )

    @property
    def orders(self) -> int:
        """The highest order that is compared."""
        return int(self.target.used.shape[-1]) - 1

    def of(self, model: AbstractPlant, solution: PeriodicSolution) -> Array:
        """Those of a motion."""
        first, sizes = solution.mesh.layout.starts[self.moving], _sizes(model)
        return np.ravel(np.asarray(solution.trajectory.x)[: sizes.size, first].T / sizes)

    def beginning(self, model: AbstractPlant, solution: PeriodicSolution, z: Array) -> PeriodicSolution:
        """A motion that begins otherwise, not solved anew."""
        excitation = solution.excitation._replace(initial_states=jnp.asarray(self._states(model, z)))
        start = with_initial_states(solution.trajectory, excitation, solution.mesh.layout)
        return replace(solution, excitation=excitation, trajectory=start)

    def known(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> InitialStates:
        """Those of a motion, with what others would change."""
        states = self._states(model, self.of(model, solution))
        return InitialStates(states, self._changes(model, p, solution))

    def solved(self, solution: PeriodicSolution) -> bool:
        """Whether a motion was found in all of the tests."""
        status = solution.status()
        return all(status[d].ok for d in self.moving)

    def missed(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> Array:
        """By how much a motion misses what is compared in the tests [sd]."""
        found = np.asarray(self.target(harmonics(model, p, solution, self.orders)))
        return np.ravel(found.reshape(self.target.used.shape[0], -1)[self.moving])

    def slopes(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> Array:
        """Slopes of that [sd], (., w m)."""
        found = self.slopes_of_all(model, p, solution)
        by_test = found.reshape(self.target.used.shape[0], -1, found.shape[1])[self.moving]
        return by_test.reshape(-1, found.shape[1])

    def slopes_of_all(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> Array:
        """Slopes of what is compared in all tests [sd], (., w m)."""
        by_test = whitened(np.asarray(self.target.whitening), self._changes(model, p, solution))
        tests, each, count = by_test.shape
        found = np.zeros((tests, each, self.moving.size, count))
        found[self.moving, :, np.arange(self.moving.size)] = by_test[self.moving]
        return np.asarray(self.target.projected(jnp.asarray(found.reshape(tests * each, -1))))

    def best(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> PeriodicSolution:
        """The motion that begins as it misses least, from one nearby; that one where none is found."""
        missed = self.missed(model, p, solution)
        for _ in range(CORRECTIONS):
            slopes = self.slopes(model, p, solution)
            step = -np.linalg.lstsq(slopes, missed)[0]
            if np.sum((slopes @ step) ** 2) < SETTLED * np.sum(missed**2):
                break
            moved = self.beginning(model, solution, self.of(model, solution) + step)
            found = resolve(model, p, moved)
            there = self.missed(model, p, found)
            if not self.solved(found) or not np.sum(there**2) < np.sum(missed**2):
                break
            solution, missed = found, there
        return solution

    def _states(self, model: AbstractPlant, z: Array) -> Array:
        """Numbers that are searched as states of all tests [SI], (D, m)."""
        sizes = _sizes(model)
        found = np.zeros((self.target.used.shape[0], sizes.size))
        found[self.moving] = z.reshape(self.moving.size, -1) * sizes
        return found

    def _changes(self, model: AbstractPlant, p: Values, solution: PeriodicSolution) -> NDArray[np.complex128]:
        sizes = _sizes(model)
        found = np.asarray(changes_by_initial_states(model, p, solution, self.orders, sizes.size))
        changes = np.zeros(found.shape, np.complex128)
        changes[self.moving] = found[self.moving] * sizes
        return changes


def _sizes(model: AbstractPlant) -> Array:
    """Typical sizes of the states of a model [SI], (m,), to the last one that does not slide."""
    rates = 2 * len(model.coordinates)
    kept = [rates, *(rates + 1 + place for place, each in enumerate(model.states) if not each.slips)]
    return np.array(state_sizes(model)[: max(kept)])


class _Point(NamedTuple):
    """Motions somewhere in a search, whether they were found, the residuals, and what finds the slopes of these."""

    solution: PeriodicSolution
    solved: bool
    residual: Array
    find_slopes: Callable[[], Array]


def _lowest(
    at: Callable[[Array, PeriodicSolution], _Point], z: Array, solution: PeriodicSolution
) -> tuple[Array, _Point, bool]:
    """Where the sum of squares is least, from ``z`` with motions of a ``solution``, and whether that was found."""
    # Campaigns that begin at rest do without.
    from scipy.optimize import least_squares

    last = at(z, solution)
    if not (last.solved and np.isfinite(last.residual).all()):
        return z, last, False
    tried = {z.tobytes(): last}

    def residual(z: Array) -> Array:
        found = tried.get(z.tobytes()) or at(z, last.solution)
        tried[z.tobytes()] = found
        fine = found.solved and bool(np.isfinite(found.residual).all())
        return found.residual if fine else np.full(found.residual.shape, np.inf)

    def slopes(z: Array) -> Array:
        nonlocal last
        last = tried[z.tobytes()]
        tried.clear()
        return last.find_slopes()

    # Without a scale of its own the first step is of a typical size.
    found = least_squares(residual, z, slopes, ftol=SETTLED, xtol=LEAST_STEP, gtol=None, max_nfev=EVALUATIONS)
    return found.x, last, found.status > 0
