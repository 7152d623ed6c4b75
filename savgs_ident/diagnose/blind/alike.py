"""Effects that do the same to a campaign: nobody can tell from it which of them the rig has.

To first order about the rig without any: effects without states by their derivatives, those with states by what
they do along its motion, for several of their shapes.
"""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.diagnose.blind.bench import ORDERS, Bench
from savgs_ident.diagnose.blind.hiding import Hiding, first_order_sigma, noise_rows, rows_of
from savgs_ident.diagnose.rig.columns import SHAPES, columns_with_states, shaped
from savgs_ident.diagnose.rig.coordinates import term_of
from savgs_ident.effects.registry import CATALOGUE
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values
from savgs_ident.posterior.likelihood import Likelihood
from savgs_ident.posterior.scales import Scales
from savgs_ident.simulate.periodic import PeriodicSolution, harmonic_sensitivities

TOLD_APART = 5.0
"""Standard deviations from which on two effects can be told apart."""

Real = NDArray[np.float64]

Ways = Mapping[str, tuple[Real, ...]]
"""By effect, for every shape that is tried: change of the rows in noise per unit of its amplitudes, (m, a)."""


def ways_of(bench: Bench, given: Mapping[str, float], solution: PeriodicSolution) -> Ways:
    """What every effect that the baseline lacks would do to a rig whose motions are ``solution``."""
    absent = {name: each for name, each in CATALOGUE.items() if name not in bench.baseline}
    model, noise = bench.model(()), noise_rows(bench)
    plain = {name: tuple(each.null) for name, each in absent.items() if not each.states}
    amplitudes = tuple(name for own in plain.values() for name in own)
    ways: dict[str, list[Real]] = {name: [] for name in absent}
    for choice in SHAPES:
        p = bench.values(dict(given) | shaped([term_of(each) for each in absent.values()], choice))
        slopes = harmonic_sensitivities(model, p, solution, amplitudes, ORDERS)
        table = {name: rows_of(each) for name, each in zip(amplitudes, np.asarray(slopes), strict=True)}
        for name, own in plain.items():
            ways[name].append(np.stack([table[each] for each in own], axis=1) / noise[:, None])
        for name, rows in _marched(bench, model, p, solution, choice).items():
            ways[name].append(rows[:, None] / noise[:, None])
    return {name: tuple(each) for name, each in ways.items()}


def alike(hiding: Hiding, change: Real, ways: Ways, name: str) -> tuple[str, ...]:
    """Effects other than ``name`` that, of some size, ``change`` the rows (m,) as it does."""
    return tuple(
        other
        for other, columns in ways.items()
        if other != name and min(first_order_sigma(hiding, change, each) for each in columns) < TOLD_APART
    )


def _marched(
    bench: Bench, model: QuarterCar, p: Values, solution: PeriodicSolution, choice: float
) -> dict[str, Real]:
    """Change of the rows by every effect with states at its typical size."""
    effects = [each for name, each in CATALOGUE.items() if each.states and name not in bench.baseline]
    typical = [
        shaped([term_of(effect)], choice)
        | {each.name: each.value for each in effect.parameters if each.name in effect.null}
        for effect in effects
    ]
    rows = columns_with_states(model, _all_rows(bench), ORDERS, p, solution, effects, typical)
    return {effect.name: each for effect, each in zip(effects, rows, strict=True)}


def _all_rows(bench: Bench) -> Likelihood:
    """Real and imaginary parts of all orders from 1 on as rows, as :func:`rows_of` has them."""
    shape = len(bench.programme.dwells), 2, ORDERS + 1
    wanted = np.broadcast_to(np.arange(ORDERS + 1)[:, None] > 0, (*shape, 2))
    nothing: Array = jnp.zeros(int(wanted.sum()))
    return Likelihood(
        axes=jnp.broadcast_to(jnp.eye(2), (*shape, 2, 2)),
        place=np.flatnonzero(wanted),
        measured=nothing,
        variance=nothing,
        reach=nothing,
        scales=Scales(),
    )
