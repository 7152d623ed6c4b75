"""How far a drawn effect stands out of a campaign, and which others do the same to it.

A spring that is 3 % stiffer than its sheet says, at a tolerance of 1.5 %, is no missing effect, and a tyre with 10 %
more friction is identified anyway. What an effect changes is therefore held against the best that the model without
it can do:

    sigma^2 = min_x  |(change - moved(x)) / noise|^2 + |x|^2

with x the parameters that are identified or known to a tolerance, in units of what is known of them beforehand. The
search takes damped Gauss-Newton steps within bounds. It is not that of :mod:`savgs_ident.inference.find_map`: the
noise is known exactly, so that no noise scale and no discrepancy may take up what stands out; the amplitudes of an
effect beside have no prior; and what is known beforehand is centred on the drawn rig, within one e-fold for an
identified parameter where a fit has three. Other widths could change what is drawn for a seed.

Which effects may do the same is seen to first order about the rig without any: effects without states by their
derivatives, those with states by what they do along its motion, for several of their shapes.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from savgs_ident.core.free_vector import known_to_tolerance
from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.diagnosis.effect_sensitivities import sensitivities_with_states
from savgs_ident.diagnosis.problem import term_of
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.likelihood import Likelihood
from savgs_ident.inference.observations import Term
from savgs_ident.inference.prior import Scales
from savgs_ident.inference.problem import used_parameters
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.sensitivity import harmonic_sensitivities
from savgs_ident.validation.virtual_rig import ORDERS, Bench

Real = NDArray[np.float64]

STEPS = 12
"""Steps of the search at most."""

SHARES = (1.0, 0.3, 0.1, 0.03)
"""Shares of a step that are tried."""

CONVERGED = 0.95
"""The search ends where a whole step leaves more than this of the square."""

ENOUGH = 2.0
"""It ends as well below so many standard deviations: nobody could see that."""


class Hiding(NamedTuple):
    """What can hide an effect, to first order about a rig.

    Attributes:
        noise: standard deviations of the rows, (m,).
        names: parameters that are identified or known to a tolerance, n.
        columns: change of the rows in noise per unit of what is known of each, (m, n).
    """

    noise: Real
    names: tuple[str, ...]
    columns: Real


def rows_of(response: NDArray[np.complex128]) -> Real:
    """Real and imaginary parts of the orders from 1 on, (m,), of a response (..., K) [unit of the reading]."""
    kept = response[..., 1:]
    return np.stack([kept.real, kept.imag], axis=-1).ravel()


def noise_rows(bench: Bench) -> Real:
    """Standard deviation of every row, (m,): white noise of the sensors over the length of each dwell."""
    each = bench.sensors
    samples = [bench.programme.periods_at(f) / f * each.rate for f in bench.programme.dwells]
    spread = np.sqrt(2.0 / np.array(samples))[:, None] * np.array([each.accel, each.deflection])
    return np.repeat(spread.ravel(), 2 * ORDERS)


def moved(each: Parameter, value: float, x: float) -> float:
    """A parameter moved from ``value`` [its unit] by ``x`` of what is known of it beforehand, within its bounds.

    ``x`` is in standard deviations.
    """
    there = value + each.tolerance * x if each.tolerance > 0.0 and not each.is_typical else value * np.exp(x)
    return float(np.clip(there, each.lower, each.upper))


def _unit(each: Parameter, value: float, unknown: bool) -> float:
    """What a step of one in a parameter of this value is [its unit]."""
    return value if unknown or each.is_typical else each.tolerance


def hiding_at(
    bench: Bench, effects: Sequence[str], given: Mapping[str, float], solution: PeriodicSolution
) -> Hiding:
    """What can hide an effect of the rig with these effects and parameters [SI], whose motions are ``solution``."""
    model, p = bench.model(effects), bench.values(given)
    used = used_parameters(model, bench.table)
    known = [name for name in known_to_tolerance(bench.table, bench.free) if name in used]
    names = (*bench.free, *known)
    slopes = np.asarray(harmonic_sensitivities(model, p, solution, names, ORDERS))
    noise = noise_rows(bench)
    units = [_unit(bench.table[name], float(p[name]), name in bench.unknown) for name in names]
    columns = [rows_of(slope) / noise * unit for slope, unit in zip(slopes, units, strict=True)]
    return Hiding(noise, names, np.stack(columns, axis=1))


def _step(
    columns: Real,
    miss: Real,
    x: Real,
    known: int,
    bounds: tuple[Real, Real] | None = None,
) -> Real:
    """The step of the search from ``x``; its first ``known`` entries have priors, it does not leave the bounds."""
    stacked = np.concatenate([columns, np.eye(known, x.size)])
    wanted = np.concatenate([miss, -x[:known]])
    lower, upper = (-np.inf, np.inf) if bounds is None else (bounds[0] - x, bounds[1] - x)
    step: Real = lsq_linear(stacked, wanted, (lower, upper), method="bvls").x
    return step


class Closest(NamedTuple):
    """How far a change stands out of the nearest that can be done, and the sizes (k,) of free columns there.

    ``sigma`` is in standard deviations, sizes are in units of the columns; ``left`` (m,) is what is left of the
    change, in its units.
    """

    sigma: float
    sizes: Real
    left: Real


def closest(hiding: Hiding, change: Real, flat: Real) -> Closest:
    """The nearest to ``change`` (m,) to first order, with columns ``flat`` (m, k) that may have any size.

    ``change`` is in the units of the rows, ``flat`` in those of their noise.
    """
    columns, known = np.concatenate([hiding.columns, flat], axis=1), hiding.columns.shape[1]
    miss = change / hiding.noise
    x = _step(columns, miss, np.zeros(columns.shape[1]), known)
    left = miss - columns @ x
    sigma = float(np.sqrt(np.sum(left**2) + np.sum(x[:known] ** 2)))
    return Closest(sigma, x[known:], left * hiding.noise)


def sigma_of(
    miss_at: Callable[[Real], Real | None],
    columns_at: Callable[[Real, Real], Real],
    start: Real,
    known: int,
    bounds: tuple[Real, Real],
) -> float:
    """How far a response stands out: the least sigma found from ``start`` (n,), with (m,) misses in noise.

    ``columns_at(x, miss)`` are minus the slopes of ``miss_at(x)``, (m, n); the first ``known`` entries of x have
    priors, and x stays between ``bounds``. Steps that make it worse, or lead where there is no motion, are shortened.
    """

    def square(x: Real, miss: Real | None) -> float:
        return np.inf if miss is None else float(miss @ miss + np.sum(x[:known] ** 2))

    x, miss = start, miss_at(start)
    best = square(x, miss)
    for _ in range(STEPS):
        if miss is None or best < ENOUGH**2:
            break
        step, before = _step(columns_at(x, miss), miss, x, known, bounds), best
        for share in SHARES:
            there = x + share * step
            found = miss_at(there)
            if square(there, found) < best:
                x, miss, best = there, found, square(there, found)
                break
        if best == before or (share == 1.0 and best > CONVERGED * before):
            break
    return float(np.sqrt(best))


SIMILAR = 0.6
"""Share of its distance from the baseline that an effect keeps, to first order, from one that may do the same."""


class Sensitivity(NamedTuple):
    """What an effect does at given shapes [SI], to first order.

    ``columns`` are the change of the rows in noise per unit of its amplitudes, (m, a).
    """

    shapes: Mapping[str, float]
    columns: Real


Sensitivities = Mapping[str, tuple[Sensitivity, ...]]
"""By effect, for every shape that is tried."""


def sensitivities_of(bench: Bench, given: Mapping[str, float], solution: PeriodicSolution) -> Sensitivities:
    """What every effect that the baseline lacks would do to a rig whose motions are ``solution``.

    ``given`` are its parameters in SI.
    """
    terms = [term_of(each) for name, each in CATALOGUE.items() if name not in bench.baseline]
    model, noise = bench.model(()), noise_rows(bench)
    found: dict[str, list[Sensitivity]] = {term.name: [] for term in terms}
    for one in range(max(len(term.tried) for term in terms)):
        some = [term for term in terms if len(term.tried) > one]
        shapes = {name: value for term in some for name, value in term.tried[one].items()}
        p = bench.values({**given, **shapes})
        rows = {**_sloped(model, p, solution, some), **_marched(bench, model, p, solution, some)}
        for term in some:
            found[term.name].append(Sensitivity(term.tried[one], rows[term.name] / noise[:, None]))
    return {name: tuple(each) for name, each in found.items()}


def similar(
    hiding: Hiding, change: Real, sensitivities: Sensitivities, name: str
) -> dict[str, dict[str, float]]:
    """Effects other than ``name`` that ``change`` the rows (m,) nearly as it does, to first order.

    With the parameters [SI] at which they do.
    """
    blank = np.zeros((change.size, 0))
    limit = SIMILAR * closest(hiding, change, blank).sigma
    found = {}
    for other in sensitivities:
        if other == name:
            continue
        nearest = [(each, closest(hiding, change, each.columns)) for each in sensitivities[other]]
        sensitivity, best = min(nearest, key=lambda each: each[1].sigma)
        if best.sigma < limit:
            null = CATALOGUE[other].null
            found[other] = {
                **sensitivity.shapes,
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
    effects, size = [CATALOGUE[term.name] for term in special], DEFAULTS.typical_coordinate
    typical = [{each.name: each.centre + size * each.scale for each in term.amplitudes} for term in special]
    rows = sensitivities_with_states(model, _all_rows(bench), ORDERS, p, solution, effects, typical)
    return {
        term.name: each[:, None] / (size * term.amplitudes[0].scale)
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
        discrepancy_scale=nothing,
        scales=Scales(),
    )
