"""What a likelihood costs that integrates every dwell by scipy.

A full evaluation takes as long as all dwells together, so single dwells are timed, each at a draw of the
posterior, and the mean times of the dwells are added up. Only integrating is timed: what else a likelihood
does (the linkage's curves, the state of rest, harmonics, the comparison) is left out, to the peer's advantage.
Road and link move as they were recorded, as in the likelihood of the package.
"""

import time
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Complex, Float
from numpy.typing import NDArray

from benchmarks.by_scipy import SETTLING_S, integrate_dwell
from benchmarks.motion import driven_rates, settling_periods
from benchmarks.outcome import Progress
from benchmarks.posterior_problem import PosteriorProblem
from savgs_ident.core.values import Values
from savgs_ident.inference.problem import Problem
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.quarter_car.dynamics import SectionCurves, section_curves
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.plant import static_equilibrium

SEED = 2


class Dwell(NamedTuple):
    """What one integration is given; harmonics of road [m] and link [rad] as (order, Re and Im)."""

    values: Values
    curves: SectionCurves
    omega: Float[Array, ""]
    road: Float[Array, "R 2"]
    link: Float[Array, "L 2"]

    def inputs(self, phase: Float[Array, ""]) -> Inputs:
        """Road and link at a phase of the cam [rad]."""
        return Inputs(
            Road(*_synthesised(self.road, self.omega, phase)),
            Link(*_synthesised(self.link, self.omega, phase)),
        )


class ScipyDwells:
    """Dwells of a problem by scipy, for any parameters: one compiled right-hand side serves them all."""

    def __init__(self, problem: Problem, excitation: Excitation) -> None:
        self.problem, self.excitation = problem, excitation
        example = self._dwell(problem.fixed, section_curves(problem.fixed), 0)
        _, unravel = ravel_pytree(example)
        self._compiled = jax.jit(lambda state, t, flat: _rates(problem, unravel(flat), state, t))
        self._rest = jax.jit(lambda dwell: _resting(problem, dwell))

    def integration(self, u: Float[np.ndarray, " n"], dwell: int) -> Callable[[], NDArray[np.float64]]:
        """The integration of one dwell at unconstrained coordinates ``u``, all prepared.

        It gives the states over a period, (1 + SAMPLES, x), once they have settled.
        """
        values = self.problem.parameters(jnp.asarray(u))
        given = self._dwell(values, section_curves(values), dwell)
        rest, (flat, _) = np.asarray(self._rest(given)), ravel_pytree(given)
        frequency = float(self.excitation.frequency[dwell])
        periods = float(settling_periods(np.asarray(frequency), SETTLING_S))
        np.asarray(self._compiled(rest, 0.0, flat))
        return lambda: integrate_dwell(self._right_side, rest, frequency, periods, (flat,))

    def _right_side(self, state: NDArray[np.float64], t: float, flat: Array) -> NDArray[np.float64]:
        return np.asarray(self._compiled(state, t, flat))

    def _dwell(self, values: Values, curves: SectionCurves, dwell: int) -> Dwell:
        omega = 2.0 * jnp.pi * self.excitation.frequency[dwell]
        return Dwell(
            values,
            curves,
            omega,
            _parts(self.excitation.harmonics["road_height"][dwell]),
            _parts(self.excitation.harmonics["link_angle"][dwell]),
        )


def time_likelihood(posed: PosteriorProblem, integrations: int, progress: Progress) -> float:
    """Time of a whole evaluation [s], from so many integrations of single dwells, each at a draw of its own."""
    dwells, count = ScipyDwells(posed.problem, posed.excitation), posed.excitation.frequency.size
    seconds = np.zeros((integrations // count, count))
    points = posed.draw(seconds.size, SEED)
    for at in range(len(seconds)):
        progress(f"scipy likelihood: {at * count} of {seconds.size} integrations")
        for dwell in range(count):
            integrate = dwells.integration(points[at * count + dwell, :-2], dwell)
            began = time.perf_counter()
            integrate()
            seconds[at, dwell] = time.perf_counter() - began
    return float(seconds.mean(axis=0).sum())


def _rates(problem: Problem, dwell: Dwell, state: Array, t: Array) -> Array:
    return driven_rates(problem.model, dwell.values, dwell.curves, state, dwell.inputs(dwell.omega * t))


def _resting(problem: Problem, dwell: Dwell) -> Array:
    """The rig at rest with road and link as they stand at phase 0."""
    inputs = dwell.inputs(jnp.zeros(()))
    found = static_equilibrium(
        problem.model, dwell.values, inputs.link.angle, inputs.road.height, dwell.curves
    )
    return jnp.concatenate([jnp.stack(found.q), jnp.zeros(2), found.s])


def _parts(harmonics: Complex[Array, " K"]) -> Float[Array, "K 2"]:
    return jnp.stack([harmonics.real, harmonics.imag], axis=-1)


def _synthesised(parts: Array, omega: Array, phase: Array) -> tuple[Array, Array]:
    """Value and time derivative of harmonics (K, 2) at a phase [rad]."""
    order = jnp.arange(parts.shape[0], dtype=parts.dtype)
    cosine, sine = jnp.cos(order * phase), jnp.sin(order * phase)
    value = cosine @ parts[:, 0] - sine @ parts[:, 1]
    rate = -(order * sine) @ parts[:, 0] - (order * cosine) @ parts[:, 1]
    return value, omega * rate
