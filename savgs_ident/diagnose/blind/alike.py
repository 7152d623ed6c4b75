"""Effects that do the same to a campaign: nobody can tell from it which of them the rig has.

To first order about the rig without any it is seen which ones may: effects without states by their derivatives, those
with states by what they do along its motion, for several of their shapes.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.diagnose.blind.bench import ORDERS, Bench
from savgs_ident.diagnose.blind.hiding import Hiding, closest, noise_rows, rows_of
from savgs_ident.diagnose.engine.prediction import Term
from savgs_ident.diagnose.rig.columns import columns_with_states
from savgs_ident.diagnose.rig.coordinates import term_of
from savgs_ident.effects.registry import CATALOGUE
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values
from savgs_ident.posterior.likelihood import Likelihood
from savgs_ident.posterior.scales import Scales
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.sensitivity import harmonic_sensitivities

SIMILAR = 0.6
"""Share of its distance from the baseline that an effect keeps, to first order, from one that may do the same."""

Real = NDArray[np.float64]


class Way(NamedTuple):
    """What an effect does at given shapes [SI]: change of the rows in noise per unit of its amplitudes, (m, a)."""

    shapes: Mapping[str, float]
    columns: Real


Ways = Mapping[str, tuple[Way, ...]]
"""By effect, for every shape that is tried."""


def ways_of(bench: Bench, given: Mapping[str, float], solution: PeriodicSolution) -> Ways:
    """What every effect that the baseline lacks would do to a rig whose motions are ``solution``.

    ``given`` are its parameters in SI.
    """
    terms = [term_of(each) for name, each in CATALOGUE.items() if name not in bench.baseline]
    model, noise = bench.model(()), noise_rows(bench)
    ways: dict[str, list[Way]] = {term.name: [] for term in terms}
    for one in range(max(len(term.tried) for term in terms)):
        some = [term for term in terms if len(term.tried) > one]
        shapes = {name: value for term in some for name, value in term.tried[one].items()}
        p = bench.values({**given, **shapes})
        rows = {**_sloped(model, p, solution, some), **_marched(bench, model, p, solution, some)}
        for term in some:
            ways[term.name].append(Way(term.tried[one], rows[term.name] / noise[:, None]))
    return {name: tuple(each) for name, each in ways.items()}


def similar(hiding: Hiding, change: Real, ways: Ways, name: str) -> dict[str, dict[str, float]]:
    """Effects other than ``name`` that ``change`` the rows (m,) nearly as it does, to first order.

    With the parameters [SI] at which they do.
    """
    blank = np.zeros((change.size, 0))
    limit = SIMILAR * closest(hiding, change, blank).sigma
    found = {}
    for other in ways:
        if other == name:
            continue
        nearest = [(way, closest(hiding, change, way.columns)) for way in ways[other]]
        way, best = min(nearest, key=lambda each: each[1].sigma)
        if best.sigma < limit:
            null = CATALOGUE[other].null
            found[other] = {
                **way.shapes,
                **{each: null[each] + float(size) for each, size in zip(null, best.sizes, strict=True)},
            }
    return found


def _sloped(
    model: QuarterCar, p: Values, solution: PeriodicSolution, terms: Sequence[Term]
) -> dict[str, Real]:
    """Derivatives of the rows in the amplitudes of every effect without states."""
    plain = [term for term in terms if not CATALOGUE[term.name].states]
    names = tuple(each.name for term in plain for each in term.amplitudes)
    slopes = np.asarray(harmonic_sensitivities(model, p, solution, names, ORDERS)) if names else ()
    table = {name: rows_of(each) for name, each in zip(names, slopes, strict=True)}
    return {term.name: np.stack([table[each.name] for each in term.amplitudes], axis=1) for term in plain}


def _marched(
    bench: Bench, model: QuarterCar, p: Values, solution: PeriodicSolution, terms: Sequence[Term]
) -> dict[str, Real]:
    """Change of the rows by every effect with states per unit of its amplitude, found at its typical size, (m, 1)."""
    special = [term for term in terms if CATALOGUE[term.name].states]
    effects = [CATALOGUE[term.name] for term in special]
    typical = [{each.name: each.centre + 0.5 * each.scale for each in term.amplitudes} for term in special]
    rows = columns_with_states(model, _all_rows(bench), ORDERS, p, solution, effects, typical)
    return {
        term.name: each[:, None] / (0.5 * term.amplitudes[0].scale)
        for term, each in zip(special, rows, strict=True)
    }


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
